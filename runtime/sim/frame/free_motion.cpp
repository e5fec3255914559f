#include "runtime/sim/frame/free_motion.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

namespace exmat::runtime {
namespace {

constexpr double kSubTurn = 0.3;  // [rad] of turn_rigidly()
constexpr int kMostSubSteps = 1000;

/// From the moments and the velocity.
bool find_spin(FreeMotionWorkspace& workspace) {
  if (workspace.spin_is_given) return true;
  Eigen::Vector3d deformation;
  kernels().rotation_dots(workspace.moments.modes, workspace.moments.deformation().data(), workspace.velocity.data(),
                          deformation.data());
  if (workspace.turn_is_given) {
    workspace.solution.spin = workspace.moments.inertia.inverse() * (workspace.turned_momentum - deformation);
    return true;
  }
  workspace.solution = solve_spin(workspace.problem, workspace.moments.inertia, deformation, workspace.solution.spin);
  return workspace.solution.converged;
}

void add_up_force(const DeformingInertia& frame, double rate, FreeMotionWorkspace& workspace) {
  const Eigen::Vector3d& spin = workspace.solution.spin;
  frame.force(workspace.moments, workspace.velocity_products, spin, spin, rate * spin, workspace.force);
}

}  // namespace

FreeMotionWorkspace::FreeMotionWorkspace(const DeformingInertia& inertia)
    : moments(inertia.make_moments()),
      velocity_products(3 * inertia.modes()),
      centre_products(3 * inertia.modes()),
      scratch(3 * inertia.modes()),
      force(Eigen::VectorXd::Zero(inertia.modes())),
      product(Eigen::VectorXd::Zero(inertia.modes())),
      velocity(Eigen::VectorXd::Zero(inertia.modes())),
      velocity_centre(Eigen::VectorXd::Zero(inertia.modes())),
      factors(Eigen::MatrixXd::Zero(inertia.modes(), 12)),
      gyroscopic(Eigen::MatrixXd::Zero(inertia.modes(), inertia.modes())) {
  moved.momentum = moved.momentum_previous = force;
}

// With the angles t of one step and s of two, omega = (4 t - s) / (2 dt): exact for a constant spin.
Eigen::Vector3d RigidUnknowns::spin(const Eigen::Vector3d& turn) const noexcept {
  if (!second_order) return turn / time_step;
  const Eigen::AngleAxisd both(last_turn * quaternion_of(turn));
  return (4 * turn - both.angle() * both.axis()) / (2 * time_step);
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
  const Eigen::Vector3d deformation = workspace.moments.deformation().transpose() * v;
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
  return find_spin(workspace);
}

void rotation_force(const DeformingInertia& frame, double rate, FreeMotionWorkspace& workspace) noexcept {
  frame.turning_products(workspace.velocity, workspace.velocity_products);
  add_up_force(frame, rate, workspace);
}

bool update_rotation(const DeformingInertia& frame, double rate, const Eigen::VectorXd& q,
                     const Eigen::VectorXd& velocity_centre, FreeMotionWorkspace& workspace) noexcept {
  workspace.velocity = rate * (q - velocity_centre);
  if (workspace.velocity_centre == velocity_centre) {
    frame.moments(q, workspace.moments);
  } else {
    workspace.velocity_centre = velocity_centre;
    frame.moments(q, velocity_centre, workspace.moments, workspace.centre_products);
  }
  const Eigen::Index count = 3 * frame.modes();
  const auto all = [count](const double* numbers) { return Eigen::Map<const Eigen::VectorXd>(numbers, count); };
  Eigen::Map<Eigen::VectorXd>(workspace.velocity_products.data(), count) =
      rate * (all(workspace.moments.deformation().data()) - all(workspace.centre_products.data()));
  const bool found = find_spin(workspace);
  add_up_force(frame, rate, workspace);
  return found;
}

void add_rotation_stiffness(const DeformingInertia& frame, double velocity_factor, FreeMotionWorkspace& workspace,
                            Eigen::MatrixXd& hessian) noexcept {
  const Eigen::Vector3d& spin = workspace.solution.spin;
  if (!workspace.spin_is_given) {
    const Eigen::Matrix3d inverse = workspace.moments.inertia.inverse();  // symmetric
    kernels().rotation_stiffness(frame.arrays(), workspace.moments.products.data(), workspace.velocity_products.data(),
                                 velocity_factor, spin.data(), inverse.data(), workspace.factors.data(), hessian.data(),
                                 hessian.outerStride());
  }
  frame.add_softening(spin, velocity_factor, hessian);
}

void set_gyroscopic(const DeformingInertia& frame, double velocity_factor, FreeMotionWorkspace& workspace) noexcept {
  Eigen::MatrixXd& G = workspace.gyroscopic;
  const auto slope = workspace.factors.leftCols<3>(), inverse_deformation = workspace.factors.middleCols<3>(6);
  G.setZero();
  frame.add_gyroscopic(workspace.solution.spin, -2 * velocity_factor, G);
  for (Eigen::Index j = 0; j < G.cols(); ++j)
    for (Eigen::Index i = j + 1; i < G.rows(); ++i) {
      const double coupling = velocity_factor * (slope.row(i).dot(inverse_deformation.row(j)) -
                                                 slope.row(j).dot(inverse_deformation.row(i)));
      G(i, j) += coupling;
      G(j, i) -= coupling;
    }
}

void gyroscopic_product(const DeformingInertia& frame, double velocity_factor, const Eigen::VectorXd& x,
                        FreeMotionWorkspace& workspace) noexcept {
  kernels().rotation_product(frame.arrays(), workspace.moments.deformation().data(), workspace.factors.data(),
                             velocity_factor, workspace.solution.spin.data(), x.data(), workspace.scratch.data(),
                             workspace.product.data());
}

void commit_free_motion(double rate, const Eigen::VectorXd& v, const FreeMotionWorkspace& workspace, Eigen::VectorXd& a,
                        FreeState& body) noexcept {
  const Eigen::Vector3d& spin = workspace.solution.spin;
  body.momentum.swap(body.momentum_previous);
  body.momentum.noalias() = v + workspace.moments.deformation().lazyProduct(spin);
  a += rate * (body.momentum - v);
  body.before = {body.position, body.orientation, body.linear_momentum, body.angular_momentum};
  body.orientation = body.orientation * quaternion_of(workspace.solution.rotation);
  body.orientation.normalize();
  body.spin = spin;
  body.position = workspace.moved.position;
  body.linear_momentum = workspace.moved.linear_momentum;
  body.angular_momentum = workspace.moved.angular_momentum;
}

}  // namespace exmat::runtime
