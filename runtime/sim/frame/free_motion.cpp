#include "runtime/sim/frame/free_motion.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <tuple>

namespace exmat::runtime {
namespace {

constexpr double kSubTurn = 0.3;  // [rad] of turn_rigidly()
constexpr int kMostSubSteps = 1000;

/// D + V, see free_motion.h, and what J^-1 makes of it and of H.
void set_rotation_slope(const DeformingInertia& frame, FreeMotionWorkspace& workspace) {
  frame.inertia_slope(workspace.moments, workspace.solution.spin, workspace.slope);
  const Eigen::Index stride = padded(frame.modes());
  for (int c = 0; c < 3; ++c)
    workspace.slope.col(c) += Eigen::Map<const Eigen::VectorXd>(workspace.scratch.data() + c * stride, frame.modes());
  const Eigen::Matrix3d inverse = workspace.moments.inertia.inverse();  // symmetric
  workspace.inverse_slope.noalias() = workspace.slope.lazyProduct(inverse);
  workspace.inverse_deformation.noalias() = workspace.moments.deformation.lazyProduct(inverse);
}

}  // namespace

FreeMotionWorkspace::FreeMotionWorkspace(const DeformingInertia& inertia)
    : moments(inertia.make_moments()),
      scratch(3 * padded(inertia.modes())),
      force(Eigen::VectorXd::Zero(inertia.modes())),
      product(Eigen::VectorXd::Zero(inertia.modes())),
      velocity(Eigen::VectorXd::Zero(inertia.modes())),
      slope(Eigen::MatrixX3d::Zero(inertia.modes(), 3)),
      inverse_slope(Eigen::MatrixX3d::Zero(inertia.modes(), 3)),
      inverse_deformation(Eigen::MatrixX3d::Zero(inertia.modes(), 3)),
      gyroscopic(Eigen::MatrixXd::Zero(inertia.modes(), inertia.modes())) {
  moved.momentum = moved.momentum_previous = force;
}

void begin_rotation(const FreeState& body, double time_step, bool dissipative,
                    FreeMotionWorkspace& workspace) noexcept {
  workspace.problem.momentum = body.orientation.conjugate() * body.angular_momentum;
  workspace.problem.factor = dissipative ? time_step : 0.5 * time_step;
  workspace.problem.offset = (time_step - workspace.problem.factor) * body.spin;
  workspace.solution.spin = body.spin;
  workspace.solution.rotation = time_step * body.spin;
  workspace.spin_is_given = workspace.turn_is_given = false;
}

void turn_rigidly(const DeformingInertia& frame, const Eigen::VectorXd& q, const Eigen::VectorXd& v, double time_step,
                  FreeMotionWorkspace& workspace) noexcept {
  frame.moments(q, workspace.moments);
  const Eigen::Matrix3d& inertia = workspace.moments.inertia;
  const Eigen::Matrix3d inverse = inertia.inverse();
  const Eigen::Vector3d deformation = workspace.moments.deformation.transpose() * v;
  Eigen::Vector3d momentum = workspace.problem.momentum, spin = inverse * (momentum - deformation);
  const double sub_turns = std::ceil(time_step * spin.norm() / kSubTurn);
  const int steps = sub_turns < kMostSubSteps ? std::max(1, static_cast<int>(sub_turns)) : kMostSubSteps;
  const double sub_step = time_step / steps;
  Eigen::Quaterniond turn = Eigen::Quaterniond::Identity();
  for (int k = 0; k < steps; ++k) {
    SpinSolution solution = solve_spin({momentum, Eigen::Vector3d::Zero(), sub_step}, inertia, deformation, spin);
    if (!solution.converged) solution.rotation = sub_step * spin;
    turn = turn * quaternion_of(solution.rotation);
    momentum = rotation_of(solution.rotation).transpose() * momentum;
    spin = inverse * (momentum - deformation);
  }
  const Eigen::AngleAxisd angle(turn.normalized());
  workspace.solution = {spin, angle.angle() * angle.axis(), true};
  workspace.turned_momentum = momentum;
  workspace.turn_is_given = true;
}

bool update_spin(const DeformingInertia& frame, const Eigen::VectorXd& q, FreeMotionWorkspace& workspace) noexcept {
  frame.moments(q, workspace.moments);
  if (workspace.spin_is_given) return true;
  const Eigen::Vector3d deformation = workspace.moments.deformation.transpose() * workspace.velocity;
  if (workspace.turn_is_given) {
    workspace.solution.spin = workspace.moments.inertia.inverse() * (workspace.turned_momentum - deformation);
    return true;
  }
  workspace.solution = solve_spin(workspace.problem, workspace.moments.inertia, deformation, workspace.solution.spin);
  return workspace.solution.converged;
}

void rotation_force(const DeformingInertia& frame, double rate, FreeMotionWorkspace& workspace) noexcept {
  const Eigen::Vector3d& spin = workspace.solution.spin;
  frame.centrifugal_force(workspace.moments, spin, workspace.force);
  frame.gyroscopic_product(spin, workspace.velocity, workspace.scratch, workspace.product);
  // W q = -H^T w.
  workspace.force += workspace.product - rate * workspace.moments.deformation.lazyProduct(spin);
}

void add_rotation_stiffness(const DeformingInertia& frame, double velocity_factor, FreeMotionWorkspace& workspace,
                            Eigen::MatrixXd& hessian) noexcept {
  const Eigen::Vector3d& spin = workspace.solution.spin;
  const double inertia = velocity_factor * velocity_factor;
  if (!workspace.spin_is_given) {
    set_rotation_slope(frame, workspace);
    const auto& [slope, deformation] = std::tie(workspace.slope, workspace.moments.deformation);
    for (Eigen::Index j = 0; j < hessian.cols(); ++j) {
      const Eigen::Index below = hessian.rows() - j;
      const Eigen::Vector3d stiffening = workspace.inverse_slope.row(j);
      const Eigen::Vector3d lost = inertia * workspace.inverse_deformation.row(j);
      hessian.col(j).tail(below) +=
          slope.bottomRows(below).lazyProduct(stiffening) - deformation.bottomRows(below).lazyProduct(lost);
    }
  }
  frame.add_softening(spin, velocity_factor, hessian);
}

void set_gyroscopic(const DeformingInertia& frame, double velocity_factor, FreeMotionWorkspace& workspace) noexcept {
  Eigen::MatrixXd& G = workspace.gyroscopic;
  G.setZero();
  frame.add_gyroscopic(workspace.solution.spin, -2 * velocity_factor, G);
  for (Eigen::Index j = 0; j < G.cols(); ++j)
    for (Eigen::Index i = j + 1; i < G.rows(); ++i) {
      const double coupling = velocity_factor * (workspace.slope.row(i).dot(workspace.inverse_deformation.row(j)) -
                                                 workspace.slope.row(j).dot(workspace.inverse_deformation.row(i)));
      G(i, j) += coupling;
      G(j, i) -= coupling;
    }
}

void gyroscopic_product(const DeformingInertia& frame, double velocity_factor, const Eigen::VectorXd& x,
                        FreeMotionWorkspace& workspace) noexcept {
  frame.gyroscopic_product(workspace.solution.spin, x, workspace.scratch, workspace.product);
  const Eigen::Vector3d by_slope = velocity_factor * (workspace.inverse_slope.transpose() * x);
  const Eigen::Vector3d by_deformation = velocity_factor * (workspace.inverse_deformation.transpose() * x);
  workspace.product = workspace.slope.lazyProduct(by_deformation) -
                      workspace.moments.deformation.lazyProduct(by_slope) - 2 * velocity_factor * workspace.product;
}

void commit_free_motion(double rate, const Eigen::VectorXd& v, const FreeMotionWorkspace& workspace, Eigen::VectorXd& a,
                        FreeState& body) noexcept {
  const Eigen::Vector3d& spin = workspace.solution.spin;
  body.momentum.swap(body.momentum_previous);
  body.momentum.noalias() = v + workspace.moments.deformation.lazyProduct(spin);
  a += rate * (body.momentum - v);
  body.orientation = body.orientation * quaternion_of(workspace.solution.rotation);
  body.orientation.normalize();
  body.spin = spin;
  body.position = workspace.moved.position;
  body.linear_momentum = workspace.moved.linear_momentum;
  body.angular_momentum = workspace.moved.angular_momentum;
}

}  // namespace exmat::runtime
