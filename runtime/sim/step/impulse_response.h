#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>

#include "common/core/arrays.h"
#include "runtime/sim/step/contact_step.h"
#include "runtime/sim/step/scene.h"
#include "runtime/sim/step/state.h"

namespace exmat::runtime {

/// k material points of a body: at rest at `rest` [k x 3], world [m], with `basis_rows` [3k x r].
struct MaterialPoints {
  const VertexArray& rest;
  const RowMatrix& basis_rows;
};

/// Response of a body in its modes to impulses where it stands at the end of a step, as one more step of backward Euler
/// would give it: the change of velocity is A^-1 J^T P with A = M + dt D + dt^2 K, K that of elasticity, example forces
/// and the host's springs, and under the conditions of hard attachments. Contacts and what spin does to A are left out.
/// n unknowns: the velocity of the centre of mass and the spin in the body's frame, of a free body, and qdot.
class ImpulseResponse {
 public:
  ImpulseResponse(const Model& model, const StepScene& scene, const State& state);

  /// [3k x n] J.
  Eigen::MatrixXd jacobian(const MaterialPoints& points) const;
  /// [n x m] A^-1 f of m columns f, with what hard attachments exert.
  Eigen::MatrixXd solve(const Eigen::MatrixXd& forces) const;
  /// [3k] of the points, world [m/s].
  Eigen::VectorXd velocity(const MaterialPoints& points) const;

  /// Gives the body impulses [3k], world [N s], and moves it on by dt times what they make of its velocity. Its momenta
  /// change by these impulses to rounding, but for what hard attachments exert.
  void apply(const MaterialPoints& points, const Eigen::VectorXd& impulses, Workspace& workspace, State& state) const;

 private:
  const Model& model_;
  const StepScene& scene_;
  BodyPose pose_;
  FrameVelocity frame_velocity_;
  const Eigen::VectorXd& v_;
  Eigen::Index rigid_;
  Eigen::MatrixXd mass_;  // rigid_ x n, of the momenta
  Eigen::LDLT<Eigen::MatrixXd> factor_;
  AttachmentWorkspace held_;
};

}  // namespace exmat::runtime
