#include "runtime/sim/free_motion.h"

#include <Eigen/LU>

namespace exmat::runtime {
namespace {

constexpr double kSmallSoftening = 0.25;  // of the inertia

/// D + V, see free_motion.h, and what J^-1 makes of it and of H.
void set_rotation_slope(const RigidFrame& frame, FreeMotionWorkspace& workspace) {
  frame.inertia_slope(workspace.moments, workspace.solution.spin, workspace.slope);
  const Eigen::Index stride = padded(frame.modes());
  for (int c = 0; c < 3; ++c)
    workspace.slope.row(c) +=
        Eigen::Map<const Eigen::VectorXd>(workspace.scratch.data() + c * stride, frame.modes()).transpose();
  const Eigen::Matrix3d inverse = workspace.moments.inertia.inverse();
  workspace.inverse_slope.noalias() = inverse.lazyProduct(workspace.slope);
  workspace.inverse_deformation.noalias() = inverse.lazyProduct(workspace.moments.deformation);
}

}  // namespace

FreeMotionWorkspace::FreeMotionWorkspace(const Model& model)
    : moments(model.rigid->make_moments()),
      scratch(3 * padded(model.modes())),
      force(Eigen::VectorXd::Zero(model.modes())),
      product(Eigen::VectorXd::Zero(model.modes())),
      velocity(Eigen::VectorXd::Zero(model.modes())),
      slope(Eigen::Matrix3Xd::Zero(3, model.modes())),
      inverse_slope(Eigen::Matrix3Xd::Zero(3, model.modes())),
      inverse_deformation(Eigen::Matrix3Xd::Zero(3, model.modes())),
      gyroscopic(Eigen::MatrixXd::Zero(model.modes(), model.modes())) {}

void begin_rotation(const FreeState& body, double time_step, bool dissipative,
                    FreeMotionWorkspace& workspace) noexcept {
  workspace.problem.momentum = body.orientation.conjugate() * body.angular_momentum;
  workspace.problem.factor = dissipative ? time_step : 0.5 * time_step;
  workspace.problem.offset = (time_step - workspace.problem.factor) * body.spin;
  workspace.solution.spin = body.spin;
  workspace.solution.rotation = time_step * body.spin;
  workspace.spin_is_given = false;
}

bool update_spin(const RigidFrame& frame, const Eigen::VectorXd& q, FreeMotionWorkspace& workspace) noexcept {
  frame.moments(q, workspace.moments);
  if (workspace.spin_is_given) return true;
  const Eigen::Vector3d deformation = workspace.moments.deformation * workspace.velocity;
  workspace.solution = solve_spin(workspace.problem, workspace.moments.inertia, deformation, workspace.solution.spin);
  return workspace.solution.converged;
}

void rotation_force(const RigidFrame& frame, double rate, FreeMotionWorkspace& workspace) noexcept {
  const Eigen::Vector3d& spin = workspace.solution.spin;
  frame.centrifugal_force(workspace.moments, spin, workspace.force);
  frame.gyroscopic_product(spin, workspace.velocity, workspace.scratch, workspace.product);
  // W q = -H^T w.
  workspace.force += workspace.product - rate * workspace.moments.deformation.transpose().lazyProduct(spin);
}

void add_rotation_stiffness(const RigidFrame& frame, double velocity_factor, FreeMotionWorkspace& workspace,
                            Eigen::MatrixXd& hessian) noexcept {
  const Eigen::Vector3d& spin = workspace.solution.spin;
  const double inertia = velocity_factor * velocity_factor;
  if (!workspace.spin_is_given) {
    set_rotation_slope(frame, workspace);
    for (Eigen::Index j = 0; j < hessian.cols(); ++j) {
      const Eigen::Vector3d stiffening = workspace.inverse_slope.col(j);
      const Eigen::Vector3d lost = inertia * workspace.inverse_deformation.col(j);
      for (Eigen::Index i = j; i < hessian.rows(); ++i)
        hessian(i, j) += workspace.slope.col(i).dot(stiffening) - workspace.moments.deformation.col(i).dot(lost);
    }
  }
  if (spin.squaredNorm() <= kSmallSoftening * inertia) frame.add_centrifugal(spin, -1, hessian);
}

void set_gyroscopic(const RigidFrame& frame, double velocity_factor, FreeMotionWorkspace& workspace) noexcept {
  Eigen::MatrixXd& G = workspace.gyroscopic;
  G.setZero();
  frame.add_gyroscopic(workspace.solution.spin, -2 * velocity_factor, G);
  for (Eigen::Index j = 0; j < G.cols(); ++j)
    for (Eigen::Index i = j + 1; i < G.rows(); ++i) {
      const double coupling = velocity_factor * (workspace.slope.col(i).dot(workspace.inverse_deformation.col(j)) -
                                                 workspace.slope.col(j).dot(workspace.inverse_deformation.col(i)));
      G(i, j) += coupling;
      G(j, i) -= coupling;
    }
}

void commit_free_motion(double rate, const FreeState& moved, const FreeMotionWorkspace& workspace,
                        State& state) noexcept {
  FreeState& body = *state.body;
  const Eigen::Vector3d& spin = workspace.solution.spin;
  body.momentum.swap(body.momentum_previous);
  body.momentum.noalias() = state.v + workspace.moments.deformation.transpose().lazyProduct(spin);
  state.a += rate * (body.momentum - state.v);
  body.orientation = body.orientation * quaternion_of(workspace.solution.rotation);
  body.orientation.normalize();
  body.spin = spin;
  body.position = moved.position;
  body.linear_momentum = moved.linear_momentum;
  body.angular_momentum = moved.angular_momentum;
}

}  // namespace exmat::runtime
