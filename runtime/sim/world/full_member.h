#pragma once

#include <Eigen/Core>
#include <limits>
#include <optional>

#include "runtime/sim/contact/moving_surface.h"
#include "runtime/sim/space/full/full_body.h"

namespace exmat::runtime {

/// A body in full space among bodies that touch: its surface where a step begins, and its part of a step that is solved
/// for all of them. Unknowns are a field d, as those of FullPotential. Refers to all that it is made of.
class FullMember {
 public:
  FullMember(const FullModel& full, const Model& model, const StepScene& scene, State& state, Workspace& workspace,
             FullWorkspace& own, const TouchingSurface& touching);

  /// Factors for the steps of a scene; allocates where they are of another.
  void fit(const StepScene& scene) { own_.fit(full_, scene); }
  /// Puts the surface where the state says, for searches.
  void place_surface();
  MovingSurface& surface() noexcept { return surface_; }
  const MovingSurface& surface() const noexcept { return surface_; }

  // One step, in this order; evaluations as often as needed.

  bool begin(const StepScene& scene, double pushed) noexcept;
  Eigen::Index unknowns() const noexcept { return full_.space.field_size(); }
  /// After a begin() of numbers that are not finite: no step will be taken.
  void fail() noexcept { own_.d.setConstant(std::numeric_limits<double>::quiet_NaN()); }
  const Eigen::VectorXd& first_iterate() const noexcept { return own_.d; }
  void stay(Eigen::Ref<Eigen::VectorXd> d) noexcept;

  /// Elements at d, with tangents.
  void start(const Eigen::VectorXd& d, Tangent tangent) noexcept;
  /// The body and its obstacles; the gradient is gradient(). `started`: start() was called there.
  PotentialEvaluation evaluate(const Eigen::VectorXd& d, bool started) noexcept;
  PotentialValue value(const Eigen::VectorXd& d) noexcept { return step_->step().potential().value(d); }
  Eigen::VectorXd& gradient() noexcept { return gradient_; }

  // At the last d.

  Placement placement() const noexcept;
  Eigen::Vector3d position(int object_vertex) const noexcept {  ///< world [m]
    const Eigen::Vector3d rest = full_.rest.row(object_vertex);
    const std::int32_t place = full_.space.place(object_vertex);
    return place < 0 ? rest : rest + Eigen::Map<const Eigen::Vector3d>(own_.potential.x.data() + 4 * place);
  }
  /// Calls work(place, share) with the place in fields of the candidate's vertex, or with those of the corners around y
  /// and less their shares; of vertices that move freely.
  template <class Work>
  void for_places(const BodyCandidates& candidates, std::size_t i, bool is_vertex, const Work& work) const {
    const auto take = [&](int object_vertex, double share) {
      if (full_.space.number(object_vertex) >= 0 && share != 0) work(full_.space.place(object_vertex), share);
    };
    if (is_vertex) return take(surface_.object_vertex(candidates.all[i].vertex), 1);
    const SurfacePlace& on = candidates.places[i];
    for (int c = 0; c < 3; ++c) take(surface_.object_corner(on.triangle, c), -on.shares[c]);
  }
  /// Takes the force from candidates of the body with itself whose vertices are all held: by bones, a clamp or a
  /// motion.
  void drop_driven(BodyCandidates& candidates) const noexcept;
  /// Displacement of a candidate's point by a field x.
  Eigen::Vector3d way(const BodyCandidates& candidates, std::size_t i, bool is_vertex,
                      const Eigen::Ref<const Eigen::VectorXd>& x) const {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for_places(candidates, i, is_vertex,
               [&](std::int32_t place, double share) { sum += share * x.segment<3>(4 * place); });
    return sum;
  }
  /// Bound on the rounding of a vertex's place, over kGapRounding [m].
  double reach() const noexcept { return full_.space.extent() + state_.full->q.lpNorm<Eigen::Infinity>(); }

  void begin_blocks() noexcept { step_->step().begin_blocks(); }
  void push(std::int32_t place, const Eigen::Matrix3d& stiffness) noexcept {
    own_.contact.at(place).pushed += stiffness.cast<float>();
  }
  void end_blocks() noexcept { step_->step().set_scales(); }
  /// product = A x; result = B residual, B near the inverse of A.
  void multiply(const Eigen::Ref<const Eigen::VectorXd>& x, Eigen::Ref<Eigen::VectorXd> product) noexcept;
  void precondition(const Eigen::Ref<const Eigen::VectorXd>& residual, Eigen::Ref<Eigen::VectorXd> result) noexcept;

  /// `others`: force and torque of the other bodies, about the centre of mass.
  const StepReport& finish(NewtonStatus status, const Eigen::VectorXd& d, const FrameMomenta& others) noexcept;
  FullBodyStep& step() noexcept { return *step_; }
  /// Momenta that external forces alone make, or nothing of a body that is not free.
  std::optional<FrameMomenta> expected_momenta() noexcept;
  Eigen::Matrix3d inertia() const noexcept { return own_.potential.rigid.inertia; }  ///< after finish() [kg m^2]
  /// True if something outside moves parts of it.
  bool is_driven() const noexcept { return full_.is_driven() || is_held(state_.attachments); }
  bool has_bones() const noexcept { return full_.skin.has_value(); }
  Energies energies() const noexcept { return runtime::energies(&full_, model_, scene_, state_); }

 private:
  const FullModel& full_;
  const Model& model_;
  const StepScene& scene_;
  State& state_;
  Workspace& workspace_;
  FullWorkspace& own_;
  MovingSurface surface_;
  Eigen::VectorXd gradient_;
  std::optional<FullBodyStep> step_;
};

/// Side of a contact, as ReducedSide: forces on it go to its vertices, and it has no columns.
struct FullSide {
  const FullMember& member;
  const MovingSurface& surface;
  Placement placement;  ///< at the last d

  const Eigen::Vector3d& position() const noexcept { return placement.position; }
  Eigen::Vector3d arm(int vertex) const noexcept {
    return member.position(surface.object_vertex(vertex)) - placement.position;
  }
  Eigen::Vector3d surface_arm(const BodyCandidates& candidates, std::size_t i) const noexcept {
    const SurfacePlace& place = candidates.places[i];
    Eigen::Vector3d sum = -placement.position;
    for (int c = 0; c < 3; ++c) sum += place.shares[c] * member.position(surface.object_corner(place.triangle, c));
    return sum;
  }
  void add_force(const BodyCandidate&, ContactSums&) const noexcept {}
  void add_surface_force(const BodyCandidates&, std::size_t, ContactSums&) const noexcept {}
  Eigen::Index unknowns() const noexcept { return 0; }
  template <class Column>
  void set_column(const BodyCandidate&, const Eigen::Vector3d&, Column&&) const {}
  template <class Column>
  void set_surface_column(const BodyCandidates&, std::size_t, const Eigen::Vector3d&, Column&&) const {}
};

}  // namespace exmat::runtime
