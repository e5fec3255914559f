#pragma once

#include <array>
#include <map>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "precompute/full_space/full_space_stepper.h"
#include "precompute/full_space/surface_contacts.h"

namespace exmat::precompute {

/// One body of a FullSpaceWorld. Model, scene and `data`, with /object and /contact, outlive it.
struct FullSpaceBody {
  FullSpaceBody(const ReducedModel& its_data, const FullSpaceModel& its_model, const FullSpaceScene& its_scene,
                FullSpaceState its_state)
      : data(&its_data), model(&its_model), scene(&its_scene), state(std::move(its_state)), workspace(its_model) {}

  const ReducedModel* data;
  const FullSpaceModel* model;
  const FullSpaceScene* scene;
  FullSpaceState state;
  FullSpaceWorkspace workspace;
  FullSpaceReport report;  ///< report of the last step
};

/// Result of one step of a FullSpaceWorld.
struct FullSpaceWorldReport {
  int touching_bodies = 0;  ///< that were solved together
  int contacts = 0;         ///< vertices with a normal force from other bodies
  runtime::NewtonReport newton;
  double seconds = 0;
  bool unconverged = false;  ///< true if any body did not converge
  bool non_finite = false;   ///< likewise; those bodies are as they were
};

/// Bodies with all their degrees of freedom that touch each other: runtime::World without bases. A body that no other
/// is near takes the step of a single one; those that may touch minimise one potential, the sum of their own and that
/// of the contacts (SurfaceContacts), by Newton's method with exact Hessians. Each direction of a pair has half of the
/// law. Frictional torque at the gap is not given back, as in the run time: angular momentum is kept to the order of
/// the step. No body touches itself.
class FullSpaceWorld {
 public:
  explicit FullSpaceWorld(const runtime::ContactLaw& law) : half_(law.half()) {}

  /// All with the same time step, in a scene of its own each.
  void add(const ReducedModel& data, const FullSpaceModel& model, const FullSpaceScene& scene, FullSpaceState state);

  std::size_t count() const { return bodies_.size(); }
  const FullSpaceBody& body(std::size_t i) const { return *bodies_[i]; }

  FullSpaceWorldReport step();

 private:
  /// Bodies that may touch, and their contacts, for one step.
  struct Touching;

  bool find_contacts(Touching& touching);
  void solve(Touching& touching, FullSpaceWorldReport& report);
  void remember(const Touching& touching);

  runtime::ContactLaw half_;
  std::vector<std::unique_ptr<FullSpaceBody>> bodies_;
  std::map<std::pair<std::size_t, std::size_t>, HeldVertices> held_;  // of the first's vertices in the second
  bool anew_ = true;
  std::vector<std::size_t> solved_;  // bodies that direction_ is for
  std::unique_ptr<SparseDirection> direction_;
};

}  // namespace exmat::precompute
