#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "tests/support/sparse_space/step_potential.h"

namespace exmat::precompute {

/// One step of a body from its beginning to its end: begin(), then whoever minimises the potential in d(), then
/// finish().
class SparseStep {
 public:
  SparseStep(const SparseModel& model, const FullSpaceScene& scene, FullSpaceState& state, SparseWorkspace& workspace)
      : model_(model), scene_(scene), state_(state), workspace_(workspace) {}
  SparseStep(const SparseStep&) = delete;
  SparseStep& operator=(const SparseStep&) = delete;

  /// True if the potential can be minimised: all numbers are finite. Near obstacles it is that of backward Euler.
  bool begin();

  StepPotential& potential() { return *potential_; }
  Eigen::VectorXd& d() { return d_; }  ///< [f] change of the displacement; the first iterate, then the solution

  bool near_obstacles() const { return terms_.contacts != nullptr; }
  /// Friction with obstacles follows the normal forces of the last evaluation.
  void refresh_friction(runtime::FrictionChange& change);

  void add(const runtime::NewtonReport& newton);
  /// The state of the end, unless a number is not finite.
  const SparseReport& finish(runtime::NewtonStatus status);

 private:
  void gather_external_force();
  bool begins_anew() const;
  runtime::StepHistory history() const { return {state_.q, state_.v, state_.q_previous, state_.v, state_.v_previous}; }
  bool find_contacts();
  void set_form(Integrator integrator);
  void set_rate_centre(Integrator integrator);
  Eigen::VectorXd start_acceleration();
  bool acts(std::size_t group) const;
  void update_targets(const Eigen::VectorXd& q);
  const MeshElasticity* undeformed(std::size_t group, const Eigen::VectorXd& target);
  void choose_first_iterate();
  void commit();

  const SparseModel& model_;
  const FullSpaceScene& scene_;
  FullSpaceState& state_;
  SparseWorkspace& workspace_;
  SparseReport report_;
  StepTerms terms_;
  VertexContacts::Step contacts_;
  std::vector<runtime::ExampleState> examples_;  // at the end of the step, of those that act
  std::optional<StepPotential> potential_;
  Eigen::VectorXd d_;
};

}  // namespace exmat::precompute
