#pragma once

#include <Eigen/Core>
#include <vector>

#include "common/core/arrays.h"
#include "common/core/decompositions.h"
#include "runtime/sim/step/contact_step.h"
#include "runtime/sim/step/scene.h"
#include "runtime/sim/step/state.h"
#include "runtime/sim/step/workspace.h"

namespace exmat::runtime {

/// k material points of a body: at rest at `rest` [k x 3], world [m], with `basis_rows` [3k x r].
struct MaterialPoints {
  const VertexArray& rest;
  const RowMatrix& basis_rows;
};

/// World place [m] of a point of a body that stands at `placement`, in its modes at q [r].
inline Eigen::Vector3d place_of(const MaterialPoints& points, Eigen::Index i, const Placement& placement,
                                const Eigen::VectorXd& q) noexcept {
  const Eigen::Vector3d own = points.rest.row(i).transpose() + points.basis_rows.middleRows<3>(3 * i).lazyProduct(q);
  return placement.to_world(own);
}

/// Response of a body in its modes to impulses where it stands at the end of a step, as one more step of backward Euler
/// would give it: the change of velocity is A^-1 J^T P with A = M + dt D + dt^2 K, K that of elasticity, example forces
/// and the host's springs, and under the conditions of hard attachments. Contacts and what spin does to A are left out.
/// n unknowns: the velocity of the centre of mass and the spin in the body's frame, of a free body, and qdot.
class ImpulseResponse {
 public:
  /// Where the state is now. Refers to all that it is made of.
  ImpulseResponse(const Model& model, const StepScene& scene, const State& state);

  /// Where the state is now, by a step of `duration` [s] in place of the scene's. An exact tangent is that of a step
  /// and may leave A indefinite. Allocates only where attachments were made or taken off since the last time.
  void update(double duration, Tangent tangent = Tangent::kPositiveSemidefinite);

  /// [3k x n] J.
  Eigen::MatrixXd jacobian(const MaterialPoints& points) const;
  /// [n x m] A^-1 f of m columns f, with what hard attachments exert.
  Eigen::MatrixXd solve(const Eigen::MatrixXd& forces) const;
  /// [3k] of the points, world [m/s].
  Eigen::VectorXd velocity(const MaterialPoints& points) const;

  // The same in place, without allocation.

  Eigen::Index unknowns() const noexcept { return rigid_ + state_.q.size(); }
  Eigen::Index rigid_unknowns() const noexcept { return rigid_; }
  void set_jacobian(const MaterialPoints& points, Eigen::MatrixXd& J) const noexcept;
  void solve_in_place(Eigen::MatrixXd& forces) noexcept;
  /// K of the reduced coordinates without the host's springs [r x r, lower triangle].
  const Eigen::MatrixXd& stiffness() const noexcept { return stiffness_; }
  /// [n] v as the unknowns have it, and places and velocities of points, world [m], [m/s].
  void set_velocity(Eigen::VectorXd& v) const noexcept;
  Eigen::Vector3d place(const MaterialPoints& points, Eigen::Index i) const noexcept;

  /// Force of an example force i on the reduced coordinates for these weights [K], into `force` [r].
  void example_force(std::size_t i, const Eigen::VectorXd& weights, Eigen::VectorXd& force) noexcept;

  /// Gives the body impulses [3k], world [N s], and moves it on by dt times what they make of its velocity. Its momenta
  /// change by these impulses to rounding, but for what hard attachments exert.
  void apply(const MaterialPoints& points, const Eigen::VectorXd& impulses, Workspace& workspace, State& state) const;

 private:
  void add_example_stiffness(double duration, Tangent tangent, Eigen::Ref<Eigen::MatrixXd> A) noexcept;

  const Model& model_;
  const StepScene& scene_;
  const State& state_;
  Placement placement_;
  FrameVelocity frame_velocity_;
  Eigen::Index rigid_;
  Eigen::MatrixXd mass_;  // rigid_ x n, of the momenta
  Eigen::MatrixXd springs_, A_, stiffness_;
  Eigen::LDLT<Eigen::MatrixXd> factor_;
  Eigen::VectorXd zero_, multipliers_;  // n, c
  InternalForce::Workspace elasticity_;
  DeformingInertia::Moments moments_;
  std::vector<ExampleWorkspace> examples_;
  AttachmentWorkspace held_;
};

}  // namespace exmat::runtime
