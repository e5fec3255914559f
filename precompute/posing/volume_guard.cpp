#include "precompute/posing/volume_guard.h"

#include <Eigen/Geometry>
#include <limits>
#include <vector>

#include "common/elastic/material.h"
#include "common/mesh/geometry.h"
#include "runtime/sim/frame/spin.h"

namespace exmat::precompute {
namespace {

/// The second derivative of the determinant of edges, which are rows, by the edges one after the other.
Matrix9 determinant_curvature(const Eigen::Matrix3d& edges) {
  Matrix9 curvature = Matrix9::Zero();
  for (int k = 0; k < 3; ++k) {
    const int next = (k + 1) % 3, last = (k + 2) % 3;
    curvature.block<3, 3>(3 * k, 3 * next) = -runtime::cross_matrix(edges.row(last).transpose());
    curvature.block<3, 3>(3 * k, 3 * last) = runtime::cross_matrix(edges.row(next).transpose());
  }
  return curvature;
}

/// Makes edges from the first corner, one after the other, of the corners of a tet.
Eigen::Matrix<double, 9, 12> edges_of_corners() {
  Eigen::Matrix<double, 9, 12> edges = Eigen::Matrix<double, 9, 12>::Zero();
  edges.rightCols<9>().setIdentity();
  for (int k = 0; k < 3; ++k) edges.block<3, 3>(3 * k, 0) = -Eigen::Matrix3d::Identity();
  return edges;
}

}  // namespace

VolumeGuard::VolumeGuard(const TetMesh& mesh, const MeshElasticity& elasticity)
    : mesh_(mesh), elasticity_(elasticity), volumes_(tet_volumes(mesh)) {}

double VolumeGuard::energy(const VertexArray& x) const {
  const Eigen::ArrayXd shares = tet_volumes({x, mesh_.tets}).cwiseQuotient(volumes_);
  if (!(shares.minCoeff() > 0)) return std::numeric_limits<double>::infinity();
  return (volumes_.array() * (kGuarded - shares).max(0).cube() / shares).sum();
}

double VolumeGuard::add(const VertexArray& x, double strength, Eigen::VectorXd& gradient,
                        LowerTriangle& hessian) const {
  static const Eigen::Matrix<double, 9, 12> to_edges = edges_of_corners();
  const TetMesh moved{x, mesh_.tets};
  std::vector<Eigen::Triplet<double>> entries;
  double sum = 0;
  for (Eigen::Index t = 0; t < mesh_.tet_count(); ++t) {
    const Eigen::Matrix<double, 4, 3> corners = tet_positions(moved, t);
    const Eigen::Matrix3d edges = corners.bottomRows<3>().rowwise() - corners.row(0);
    const double unit = 1 / (6 * volumes_[t]), share = unit * edges.determinant(), lacking = kGuarded - share;
    if (lacking <= 0) continue;
    Eigen::Matrix<double, 9, 1> slopes;  // of the share, by the edges
    for (int k = 0; k < 3; ++k)
      slopes.segment<3>(3 * k) = unit * edges.row((k + 1) % 3).cross(edges.row((k + 2) % 3)).transpose();
    const double scale = strength * volumes_[t], ratio = lacking / share;
    sum += scale * lacking * lacking * ratio;
    const double first = -scale * ratio * lacking * (3 + ratio), second = 2 * scale * ratio * (3 + ratio * (3 + ratio));
    const Matrix9 curvature = project_positive_semidefinite(second * slopes * slopes.transpose() +
                                                            first * unit * determinant_curvature(edges));
    const Eigen::Matrix<double, 12, 1> pull = to_edges.transpose() * (first * slopes);
    const Eigen::Matrix<double, 12, 12> stiffness = to_edges.transpose() * curvature * to_edges;
    for (int i = 0; i < 12; ++i) {
      const std::int32_t row = 3 * mesh_.tets(t, i / 3) + i % 3;
      gradient[row] += pull[i];
      for (int j = 0; j < 12; ++j) entries.emplace_back(row, 3 * mesh_.tets(t, j / 3) + j % 3, stiffness(i, j));
    }
  }
  if (entries.empty()) return sum;
  Eigen::SparseMatrix<double, Eigen::RowMajor> added(hessian.rows(), hessian.cols());
  added.setFromTriplets(entries.begin(), entries.end());
  hessian.coeffs() += elasticity_.values_of(added).array();
  return sum;
}

}  // namespace exmat::precompute
