#include "precompute/posing/volume_guard.h"

#include <Eigen/Geometry>
#include <limits>
#include <vector>

#include "common/mesh/geometry.h"

namespace exmat::precompute {

VolumeGuard::VolumeGuard(const TetMesh& mesh, const MeshElasticity& elasticity)
    : mesh_(mesh), elasticity_(elasticity), volumes_(tet_volumes(mesh)) {}

double VolumeGuard::energy(const VertexArray& x) const {
  const Eigen::ArrayXd shares = tet_volumes({x, mesh_.tets}).cwiseQuotient(volumes_);
  if (!(shares.minCoeff() > 0)) return std::numeric_limits<double>::infinity();
  return (volumes_.array() * (kGuarded - shares).max(0).cube() / shares).sum();
}

double VolumeGuard::add(const VertexArray& x, double strength, Eigen::VectorXd& gradient,
                        LowerTriangle& hessian) const {
  const TetMesh moved{x, mesh_.tets};
  std::vector<Eigen::Triplet<double>> entries;
  double sum = 0;
  for (Eigen::Index t = 0; t < mesh_.tet_count(); ++t) {
    const Eigen::Matrix<double, 4, 3> corners = tet_positions(moved, t);
    const Eigen::Matrix3d edges = corners.bottomRows<3>().rowwise() - corners.row(0);
    const double share = edges.determinant() / (6 * volumes_[t]), lacking = kGuarded - share;
    if (lacking <= 0) continue;
    Eigen::Matrix<double, 4, 3> slopes;  // of the share, by the corners
    for (int k = 0; k < 3; ++k)
      slopes.row(k + 1) = edges.row((k + 1) % 3).cross(edges.row((k + 2) % 3)) / (6 * volumes_[t]);
    slopes.row(0) = -slopes.bottomRows<3>().colwise().sum();
    const double scale = strength * volumes_[t], ratio = lacking / share;
    sum += scale * lacking * lacking * ratio;
    const double first = -scale * ratio * lacking * (3 + ratio), second = 2 * scale * ratio * (3 + ratio * (3 + ratio));
    for (int i = 0; i < 4; ++i) {
      const std::int32_t row = 3 * mesh_.tets(t, i);
      gradient.segment<3>(row) += first * slopes.row(i).transpose();
      for (int j = 0; j < 4; ++j)
        for (int a = 0; a < 3; ++a)
          for (int c = 0; c < 3; ++c)
            entries.emplace_back(row + a, 3 * mesh_.tets(t, j) + c, second * slopes(i, a) * slopes(j, c));
    }
  }
  if (entries.empty()) return sum;
  Eigen::SparseMatrix<double, Eigen::RowMajor> added(hessian.rows(), hessian.cols());
  added.setFromTriplets(entries.begin(), entries.end());
  hessian.coeffs() += elasticity_.values_of(added).array();
  return sum;
}

}  // namespace exmat::precompute
