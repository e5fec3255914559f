#include "runtime/sim/space/full/rigid_part.h"

#include <Eigen/Geometry>
#include <Eigen/LU>

#include "common/core/decompositions.h"

namespace exmat::runtime {
namespace {

/// sum of a_i x b_i.
template <typename A, typename B>
Eigen::Vector3d sum_of_crosses(const Eigen::MatrixBase<A>& a, const Eigen::MatrixBase<B>& b) noexcept {
  Eigen::Matrix4d products;
  products.noalias() = a.lazyProduct(b.transpose());
  return {products(1, 2) - products(2, 1), products(2, 0) - products(0, 2), products(0, 1) - products(1, 0)};
}

template <typename A>
Eigen::Matrix3d sum_of_products(const Eigen::MatrixBase<A>& a, const Eigen::Matrix4Xd& b) noexcept {
  Eigen::Matrix4d products;
  products.noalias() = a.lazyProduct(b.transpose());
  return products.topLeftCorner<3, 3>();
}

Eigen::Matrix3d rotation_nearest_to(const Eigen::Matrix3d& matrix) noexcept {
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(matrix, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Matrix3d U = svd.matrixU();
  if ((U * svd.matrixV().transpose()).determinant() < 0) U.col(2) *= -1;
  return U * svd.matrixV().transpose();
}

/// A^-1 of RigidPart::spin(), of sum m y X^T.
Eigen::Matrix3d inverse_of(const Eigen::Matrix3d& standing) noexcept {
  return (standing.trace() * Eigen::Matrix3d::Identity() - standing).inverse();
}

Eigen::Matrix4d crossing(const Eigen::Vector3d& w) noexcept {
  Eigen::Matrix4d matrix = Eigen::Matrix4d::Zero();
  matrix.topLeftCorner<3, 3>() << 0, -w[2], w[1], w[2], 0, -w[0], -w[1], w[0], 0;
  return matrix;
}

}  // namespace

RigidWorkspace::RigidWorkspace(const FullSpace& space)
    : arms(Eigen::Matrix4Xd::Zero(4, space.vertices())), weighted(arms) {}

RigidPart::RigidPart(const FullSpace& space, const VertexArray& rest)
    : mass_matrix_(space.mass()), masses_(space.masses()) {
  mass_ = masses_.sum();
  rest_.setZero(4, space.vertices());
  for (Eigen::Index v = 0; v < rest.rows(); ++v) rest_.col(space.place(v)).head<3>() = rest.row(v);
  centre_ = rest_.topRows<3>() * masses_ / mass_;
  rest_.topRows<3>().colwise() -= centre_;
  weighted_rest_ = rest_ * mass_matrix_;
}

void RigidPart::place(const double* u, RigidWorkspace& workspace) const noexcept {
  const Field moved = as_columns(u);
  const Eigen::Vector4d mean = moved.lazyProduct(masses_) / mass_;
  workspace.centre = centre(u);
  workspace.arms = (rest_ + moved).colwise() - mean;
  workspace.weighted.setZero();
  for (Eigen::Index i = 0; i < mass_matrix_.outerSize(); ++i)
    for (FullSpace::Scalar::InnerIterator entry(mass_matrix_, i); entry; ++entry)
      workspace.weighted.col(i) += entry.value() * workspace.arms.col(entry.col());
  workspace.rotation = rotation_nearest_to(sum_of_products(workspace.arms, weighted_rest_));
  const Eigen::Matrix3d second = sum_of_products(workspace.arms, workspace.weighted);
  workspace.inertia = second.trace() * Eigen::Matrix3d::Identity() - second;
}

FrameMomenta RigidPart::momenta(const double* v, const RigidWorkspace& workspace) const noexcept {
  const Eigen::Vector4d linear = as_columns(v).lazyProduct(masses_);
  return {linear.head<3>(), sum_of_crosses(workspace.weighted, as_columns(v))};
}

FrameMomenta RigidPart::sums(const double* forces, const RigidWorkspace& workspace) const noexcept {
  const Field columns = as_columns(forces);
  const Eigen::Vector4d sum = columns.rowwise().sum();
  return {sum.head<3>(), sum_of_crosses(workspace.arms, columns)};
}

FrameVelocity RigidPart::motion(const FrameMomenta& momenta, const RigidWorkspace& workspace) const noexcept {
  return {momenta.linear / mass_, workspace.inertia.inverse() * momenta.angular};
}

void RigidPart::add_motion(const FrameVelocity& motion, const RigidWorkspace& workspace, double* v) noexcept {
  const Eigen::Vector4d straight(motion.linear[0], motion.linear[1], motion.linear[2], 0);
  Eigen::Map<Eigen::Matrix4Xd>(v, 4, workspace.arms.cols()) +=
      (crossing(motion.angular).lazyProduct(workspace.arms)).colwise() + straight;
}

void RigidPart::remove_motion(const RigidWorkspace& workspace, double* v) const noexcept {
  const FrameVelocity own = motion(momenta(v, workspace), workspace);
  add_motion({-own.linear, -own.angular}, workspace, v);
}

RigidPart::Turn RigidPart::turn(const double* u) const noexcept {
  const Eigen::Matrix3d products = sum_of_products(rest_ + as_columns(u), weighted_rest_);  // sum m X = 0
  const Eigen::Matrix3d rotation = rotation_nearest_to(products);
  return {rotation, inverse_of(rotation.transpose() * products)};
}

// The adjoint of v - spin(v) x arms.
void RigidPart::remove_torque(const Turn& turn, const double* u, double* forces) const noexcept {
  Eigen::Map<Eigen::Matrix4Xd> all(forces, 4, rest_.cols());
  const Eigen::Vector3d torque = sum_of_crosses(rest_ + as_columns(u), all);  // their sum is 0
  const Eigen::Vector3d own = turn.inverse.transpose() * (turn.rotation.transpose() * torque);
  Eigen::Matrix4d to_world = Eigen::Matrix4d::Zero();
  to_world.topLeftCorner<3, 3>() = turn.rotation;
  all -= (to_world * crossing(own)).lazyProduct(weighted_rest_);
}

void RigidPart::remove_rigid_force(const double* u, const RigidWorkspace& workspace, double* forces) const noexcept {
  Eigen::Map<Eigen::Matrix4Xd> all(forces, 4, rest_.cols());
  const Eigen::Vector4d sum = all.rowwise().sum();
  const Eigen::Vector3d arm = centre(u) - centre_;
  const Eigen::Vector3d torque = sum_of_crosses(rest_ + as_columns(u), all) - arm.cross(sum.head<3>());
  const FrameVelocity rigid = motion({sum.head<3>(), torque}, workspace);
  const Eigen::Vector4d straight(rigid.linear[0], rigid.linear[1], rigid.linear[2], 0);
  all -= straight.lazyProduct(masses_.transpose()) + crossing(rigid.angular).lazyProduct(workspace.weighted);
}

// A w = sum m X x R^T v with A = sum m ((X . y) I - y X^T), y = R^T (x - c): the condition on the frame,
// differentiated.
Eigen::Vector3d RigidPart::spin(const double* v, const RigidWorkspace& workspace) const noexcept {
  const Eigen::Matrix3d to_frame = workspace.rotation.transpose();
  Eigen::Matrix4d velocities, places;
  velocities.noalias() = as_columns(v).lazyProduct(weighted_rest_.transpose());
  places.noalias() = workspace.arms.lazyProduct(weighted_rest_.transpose());
  const Eigen::Matrix3d moving = to_frame * velocities.topLeftCorner<3, 3>();
  const Eigen::Matrix3d standing = to_frame * places.topLeftCorner<3, 3>();
  // moving(b, a) = sum m X_a v_b.
  const Eigen::Vector3d turn(moving(2, 1) - moving(1, 2), moving(0, 2) - moving(2, 0), moving(1, 0) - moving(0, 1));
  return workspace.rotation * (inverse_of(standing) * turn);
}

}  // namespace exmat::runtime
