#include "runtime/sim/frame/carried_motion.h"

namespace exmat::runtime {

CarriedWorkspace::CarriedWorkspace(const CarriedInertia& carried)
    : moments(carried.moments.make_moments()),
      scratch(3 * padded(carried.moments.modes())),
      force(Eigen::VectorXd::Zero(carried.moments.modes())),
      product(force),
      velocity(force),
      gyroscopic(Eigen::MatrixXd::Zero(force.size(), force.size())) {}

void set_frame(const MotionSample& frame, CarriedWorkspace& workspace) noexcept {
  workspace.frame = frame;
  workspace.spin = frame.rotation.transpose() * frame.angular_velocity;
  workspace.spin_rate = frame.rotation.transpose() * frame.angular_acceleration;
}

void add_carried_load(const CarriedInertia& carried, const RowMatrix& gravity_load, const Eigen::Vector3d& gravity,
                      const CarriedWorkspace& workspace, Eigen::VectorXd& force) noexcept {
  const MotionSample& frame = workspace.frame;
  const Eigen::Vector3d felt = gravity - frame.acceleration_of(carried.moments.centre_of_mass());
  force.noalias() += gravity_load.transpose() * (frame.rotation.transpose() * felt);
  force.noalias() -= carried.spin_load.transpose() * workspace.spin_rate;
}

void carried_force(const CarriedInertia& carried, const Eigen::VectorXd& q, CarriedWorkspace& workspace) noexcept {
  const DeformingInertia& frame = carried.moments;
  frame.moments(q, workspace.moments);
  frame.turning_products(workspace.velocity, workspace.scratch);
  frame.force(workspace.moments, workspace.scratch, workspace.spin, 2 * workspace.spin, workspace.spin_rate,
              workspace.force);
}

void set_gyroscopic(const CarriedInertia& carried, double velocity_factor, CarriedWorkspace& workspace) noexcept {
  workspace.gyroscopic.setZero();
  carried.moments.add_gyroscopic(2 * velocity_factor * workspace.spin + workspace.spin_rate, -1, workspace.gyroscopic);
}

void gyroscopic_product(const CarriedInertia& carried, double velocity_factor, const Eigen::VectorXd& x,
                        CarriedWorkspace& workspace) noexcept {
  const Eigen::Vector3d turn = -2 * velocity_factor * workspace.spin - workspace.spin_rate;
  carried.moments.gyroscopic_product(turn, x, workspace.scratch, workspace.product);
}

CarriedState carried_state(const CarriedInertia& carried, const RowMatrix& gravity_load, const Eigen::Vector3d& gravity,
                           const Eigen::VectorXd& q, const Eigen::VectorXd& v,
                           const CarriedWorkspace& workspace) noexcept {
  const MotionSample& frame = workspace.frame;
  const double mass = carried.moments.mass();
  const Eigen::Vector3d centre = carried.moments.centre_of_mass(), &spin = workspace.spin;
  const Eigen::Vector3d velocity = frame.rotation.transpose() * frame.velocity_at(frame.to_world(centre));
  const Eigen::Vector3d first = gravity_load.lazyProduct(q), first_rate = gravity_load.lazyProduct(v);
  const Eigen::Vector3d momentum = carried.spin_load.lazyProduct(v) + workspace.moments.deformation().transpose() * v;
  CarriedState state;
  state.frame = frame;
  state.kinetic_energy =
      0.5 * (mass * velocity.squaredNorm() + spin.dot(workspace.moments.inertia * spin) + v.squaredNorm()) +
      velocity.dot(spin.cross(first) + first_rate) + spin.dot(momentum);
  const Eigen::Vector3d way = mass * (frame.to_world(centre) - centre) + frame.rotation * first - first;
  state.potential_of_frame = -gravity.dot(way);
  return state;
}

}  // namespace exmat::runtime
