#include "precompute/study/stability/body_scale.h"

#include <algorithm>
#include <cmath>
#include <random>

#include "common/core/decompositions.h"
#include "common/mesh/geometry.h"

namespace exmat::precompute {

double BodyScale::load_norm(const Eigen::VectorXd& force) const {
  return std::sqrt(std::max(0.0, force.dot(rest_stiffness.llt().solve(force))));
}

BodyScale measure_scale(const VertexArray& vertices, const RowMatrix& basis, const runtime::InternalForce& elasticity) {
  BodyScale scale;
  auto workspace = elasticity.make_workspace();
  const Eigen::VectorXd rest = Eigen::VectorXd::Zero(elasticity.modes());
  Eigen::MatrixXd stiffness = Eigen::MatrixXd::Zero(rest.size(), rest.size());
  elasticity.stiffness(rest, runtime::Tangent::kExact, workspace, stiffness);
  scale.rest_stiffness = stiffness.selfadjointView<Eigen::Lower>();
  scale.size = bounding_box_diagonal(vertices);
  scale.reach = reach_of(basis, scale.rest_stiffness);
  return scale;
}

// The largest singular value of L^-1 U_v^T, K = L L^T.
double reach_of(const RowMatrix& basis, const Eigen::MatrixXd& stiffness) {
  const Eigen::LLT<Eigen::MatrixXd> factor(stiffness);
  double largest = 0;
  for (Eigen::Index v = 0; v < basis.rows() / 3; ++v) {
    const Eigen::MatrixXd scaled = factor.matrixL().solve(basis.middleRows<3>(3 * v).transpose());
    largest = std::max(largest, scaled.jacobiSvd().singularValues()[0]);
  }
  return largest;
}

double largest_displacement(const RowMatrix& basis, const Eigen::VectorXd& q) {
  const Eigen::VectorXd u = basis * q;
  return u.reshaped<Eigen::RowMajor>(u.size() / 3, 3).rowwise().norm().maxCoeff();
}

Eigen::VectorXd nearest_pose(const RowMatrix& basis, const VertexArray& field) {
  const Eigen::VectorXd flat = field.reshaped<Eigen::RowMajor>();
  const Eigen::MatrixXd normal = basis.transpose() * basis;
  return normal.llt().solve(basis.transpose() * flat);
}

Eigen::VectorXd random_pose(const RowMatrix& basis, double reach) {
  std::mt19937 generator(1);
  Eigen::VectorXd q(basis.cols());
  for (double& number : q) number = 2 * (static_cast<double>(generator()) / 4294967295.0) - 1;
  return reach / largest_displacement(basis, q) * q;
}

Eigen::Vector3d angular_momentum(const runtime::DeformingInertia& inertia, const runtime::State& state) {
  auto now = inertia.make_moments();
  inertia.moments(state.q, now);
  const runtime::FreeState& body = runtime::free_state(state);
  return body.orientation * (now.inertia * body.spin + now.deformation().transpose() * state.v);
}

}  // namespace exmat::precompute
