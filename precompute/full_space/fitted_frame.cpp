#include "precompute/full_space/fitted_frame.h"

#include <Eigen/Geometry>
#include <Eigen/LU>

#include "precompute/shape_space/transfer.h"

namespace exmat::precompute {
namespace {

using Field = Eigen::Map<const VertexArray>;

Field as_field(const Eigen::VectorXd& vector) { return {vector.data(), vector.size() / 3, 3}; }

Eigen::VectorXd flattened(const VertexArray& field) { return field.reshaped<Eigen::RowMajor>(); }

// sum_i a_i x b_i.
Eigen::Vector3d sum_of_crosses(const VertexArray& a, const VertexArray& b) {
  const Eigen::Matrix3d products = a.transpose() * b;
  return {products(1, 2) - products(2, 1), products(2, 0) - products(0, 2), products(0, 1) - products(1, 0)};
}

// [n x 3] rows v x a_i.
VertexArray cross_rows(const Eigen::Vector3d& v, const VertexArray& a) {
  Eigen::Matrix3d turn;
  turn << 0, -v[2], v[1], v[2], 0, -v[0], -v[1], v[0], 0;
  return a * turn.transpose();
}

}  // namespace

FittedFrame::FittedFrame(const TetMesh& mesh, const SparseMatrix& mass) {
  weights_ = mass * Eigen::VectorXd::Ones(mesh.vertex_count());
  mass_ = weights_.sum();
  weights_ /= mass_;
  centre_ = mesh.vertices.transpose() * weights_;
  rest_ = mesh.vertices.rowwise() - centre_.transpose();
  mass_rest_ = mass * rest_;
}

// With sum m X x u = 0 at every time, A w = sum m X x R^T x' for the spin w, A = sum m ((X . y) I - y X^T).
FittedFrame::Placement FittedFrame::place(const Eigen::VectorXd& displacement) const {
  Placement placement;
  const Eigen::Vector3d moved = as_field(displacement).transpose() * weights_;
  placement.centre = centre_ + moved;
  const VertexArray arms = (rest_ + as_field(displacement)).rowwise() - moved.transpose();
  placement.rotation = procrustes_rotation(arms.transpose() * mass_rest_);
  placement.positions = arms * placement.rotation;
  const Eigen::Matrix3d moments = placement.positions.transpose() * mass_rest_;
  placement.spin = (moments.trace() * Eigen::Matrix3d::Identity() - moments).inverse();
  return placement;
}

Eigen::VectorXd FittedFrame::deformation(const Placement& placement) const {
  return flattened(placement.positions - rest_);
}

Eigen::VectorXd FittedFrame::rate(const Placement& placement, const Eigen::VectorXd& direction) const {
  const Eigen::RowVector3d mean = weights_.transpose() * as_field(direction);
  const VertexArray local = (as_field(direction).rowwise() - mean) * placement.rotation;
  const Eigen::Vector3d spin = placement.spin * sum_of_crosses(mass_rest_, local);
  return flattened(local - cross_rows(spin, placement.positions));
}

Eigen::VectorXd FittedFrame::force(const Placement& placement, const Eigen::VectorXd& g) const {
  const Eigen::Vector3d turn = placement.spin.transpose() * sum_of_crosses(placement.positions, as_field(g));
  const VertexArray world = (as_field(g) - cross_rows(turn, mass_rest_)) * placement.rotation.transpose();
  return flattened(world - weights_ * world.colwise().sum());
}

Eigen::VectorXd FittedFrame::to_world(const Placement& placement, const Eigen::VectorXd& field) {
  return flattened(as_field(field) * placement.rotation.transpose());
}

Eigen::VectorXd FittedFrame::to_frame(const Placement& placement, const Eigen::VectorXd& field) {
  return flattened(as_field(field) * placement.rotation);
}

}  // namespace exmat::precompute
