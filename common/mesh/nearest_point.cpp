#include "common/mesh/nearest_point.h"

#include <Eigen/LU>
#include <cmath>
#include <limits>
#include <vector>

#include "common/core/decompositions.h"
#include "common/mesh/geometry.h"

namespace exmat {
namespace {

using CornerPoints = Eigen::Matrix<double, 4, 3>;
using Box = Eigen::AlignedBox3d;

constexpr double kFarthest = 1e150;  // coordinates beyond count as this: their squares are not finite

struct Nearest {
  Eigen::Vector4d weights = Eigen::Vector4d::Zero();
  double squared_distance = std::numeric_limits<double>::infinity();
};

// Takes the point with these weights if it is in the simplex and nearer than what is held.
void offer(const CornerPoints& corners, const Eigen::Vector3d& point, const Eigen::Vector4d& weights,
           Nearest& nearest) {
  if (weights.minCoeff() < 0) return;
  const double squared = (corners.transpose() * weights - point).squaredNorm();
  if (squared < nearest.squared_distance) nearest = {weights, squared};
}

// Projection of the point onto the affine hull of the corners in `subset` (bits); not offered where it falls outside.
void offer_face(const CornerPoints& corners, const Eigen::Vector3d& point, unsigned subset, Nearest& nearest) {
  Eigen::Matrix<double, 3, Eigen::Dynamic, 0, 3, 3> edges(3, 0);
  int members[4];
  int count = 0;
  for (int corner = 0; corner < 4; ++corner)
    if ((subset >> corner & 1U) != 0) members[count++] = corner;
  const Eigen::Vector3d origin = corners.row(members[0]);
  edges.resize(3, count - 1);
  for (int k = 1; k < count; ++k) edges.col(k - 1) = corners.row(members[k]).transpose() - origin;
  Eigen::Vector4d weights = Eigen::Vector4d::Zero();
  weights[members[0]] = 1;
  if (count > 1) {
    const Eigen::MatrixXd gram = edges.transpose() * edges;
    const Eigen::VectorXd local = gram.ldlt().solve(edges.transpose() * (point - origin));
    for (int k = 1; k < count; ++k) weights[members[k]] = local[k - 1];
    weights[members[0]] -= local.sum();
  }
  offer(corners, point, weights, nearest);
}

// The nearest point of a simplex is the nearest of the projections onto its faces of every dimension that fall inside
// them.
Nearest nearest_in_tet(const CornerPoints& corners, const Eigen::Vector3d& point) {
  const Eigen::Matrix3d edges = (corners.bottomRows<3>().rowwise() - corners.row(0)).transpose();
  const Eigen::Vector3d local = edges.inverse() * (point - corners.row(0).transpose());
  Nearest nearest;
  const Eigen::Vector4d weights(1 - local.sum(), local[0], local[1], local[2]);
  if (weights.minCoeff() >= 0) return {weights, 0.0};
  for (unsigned subset = 1; subset < 15; ++subset) offer_face(corners, point, subset, nearest);
  return nearest;
}

// For Eigen's BVMinimize over the tets.
struct Minimiser {
  using Scalar = double;
  const TetMesh& mesh;
  Eigen::Vector3d point;
  Nearest nearest{};
  int tet = 0;

  double minimumOnVolume(const Box& box) const { return box.squaredExteriorDistance(point); }
  double minimumOnObject(int candidate) {
    const Nearest found = nearest_in_tet(tet_positions(mesh, candidate), point);
    // Ties on shared faces go to the lowest tet, whatever the order of the search.
    if (found.squared_distance < nearest.squared_distance ||
        (found.squared_distance == nearest.squared_distance && candidate < tet)) {
      nearest = found;
      tet = candidate;
    }
    return found.squared_distance;
  }
};

}  // namespace

NearestPointSearch::NearestPointSearch(const TetMesh& mesh) : mesh_(mesh), tree_(tree_of(mesh)) {}

NearestPointSearch::Tree NearestPointSearch::tree_of(const TetMesh& mesh) {
  std::vector<int> ids(static_cast<std::size_t>(mesh.tet_count()));
  std::vector<Box> boxes(ids.size());
  for (std::size_t t = 0; t < ids.size(); ++t) {
    ids[t] = static_cast<int>(t);
    const CornerPoints corners = tet_positions(mesh, static_cast<Eigen::Index>(t));
    boxes[t] = Box(corners.colwise().minCoeff().transpose(), corners.colwise().maxCoeff().transpose());
  }
  return {ids.begin(), ids.end(), boxes.begin(), boxes.end()};
}

NearestPoint NearestPointSearch::nearest(const Eigen::Vector3d& point) const {
  Minimiser minimiser{mesh_, point.cwiseMax(-kFarthest).cwiseMin(kFarthest)};
  Eigen::BVMinimize(tree_, minimiser);
  return {minimiser.tet, minimiser.nearest.weights, std::sqrt(minimiser.nearest.squared_distance)};
}

Eigen::SparseMatrix<double, Eigen::RowMajor> BarycentricPoints::interpolation(const TetMesh& mesh) const {
  std::vector<Eigen::Triplet<double>> entries;
  for (Eigen::Index k = 0; k < tets.size(); ++k)
    for (int corner = 0; corner < 4; ++corner)
      entries.emplace_back(static_cast<int>(k), mesh.tets(tets[k], corner), weights(k, corner));
  Eigen::SparseMatrix<double, Eigen::RowMajor> matrix(tets.size(), mesh.vertex_count());
  matrix.setFromTriplets(entries.begin(), entries.end());
  return matrix;
}

BarycentricPoints nearest_points(const TetMesh& mesh, const VertexArray& points) {
  const NearestPointSearch search(mesh);
  BarycentricPoints result{IndexVector(points.rows()), Eigen::Matrix<double, Eigen::Dynamic, 4>(points.rows(), 4),
                           Eigen::VectorXd(points.rows())};
#pragma omp parallel for schedule(dynamic, 64)
  for (Eigen::Index k = 0; k < points.rows(); ++k) {
    const NearestPoint found = search.nearest(points.row(k).transpose());
    result.tets[k] = static_cast<std::int32_t>(found.tet);
    result.weights.row(k) = found.weights;
    result.distances[k] = found.distance;
  }
  return result;
}

}  // namespace exmat
