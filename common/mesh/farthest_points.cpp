#include "common/mesh/farthest_points.h"

#include <limits>
#include <numeric>

namespace exmat {

std::vector<Eigen::Index> farthest_points(const VertexArray& points, Eigen::Index count) {
  std::vector<Eigen::Index> chosen;
  if (count >= points.rows()) {
    chosen.resize(static_cast<std::size_t>(points.rows()));
    std::iota(chosen.begin(), chosen.end(), Eigen::Index{0});
    return chosen;
  }
  const Eigen::RowVector3d centroid = points.colwise().mean();
  Eigen::VectorXd distances = (points.rowwise() - centroid).rowwise().squaredNorm();
  Eigen::Index next = 0;
  distances.maxCoeff(&next);
  distances.setConstant(std::numeric_limits<double>::infinity());
  while (std::ssize(chosen) < count) {
    chosen.push_back(next);
    distances = distances.cwiseMin((points.rowwise() - points.row(next)).rowwise().squaredNorm());
    distances.maxCoeff(&next);
  }
  return chosen;
}

}  // namespace exmat
