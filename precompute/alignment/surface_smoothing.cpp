#include "precompute/alignment/surface_smoothing.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numbers>
#include <set>
#include <vector>

#include "precompute/alignment/surface_tree.h"

namespace exmat::precompute {
namespace {

constexpr double kFlatAngle = 10 * std::numbers::pi / 180;  // angle of an edge within a flat [rad]
constexpr double kNearRight = 10 * std::numbers::pi / 180;  // difference from a right angle [rad]
constexpr double kRightAngles = 0.9;                        // of the length of edges that are not flat
constexpr double kStaircase = 0.15;                         // of it, inward
constexpr double kShrink = 0.5, kGrow = -0.53;              // Taubin's two steps
constexpr int kSmoothings = 8;

// An edge at which two triangles meet.
struct Edge {
  std::array<std::int32_t, 2> triangles{-1, -1};
};

using Edges = std::map<std::array<std::int32_t, 2>, Edge>;

Edges edges_of(const TriangleArray& triangles) {
  Edges edges;
  for (Eigen::Index k = 0; k < triangles.rows(); ++k)
    for (int corner = 0; corner < 3; ++corner) {
      const auto a = triangles(k, corner), b = triangles(k, (corner + 1) % 3);
      Edge& edge = edges[{std::min(a, b), std::max(a, b)}];
      edge.triangles[edge.triangles[0] < 0 ? 0 : 1] = static_cast<std::int32_t>(k);
    }
  return edges;
}

}  // namespace

double staircase_share(const VertexArray& vertices, const TriangleArray& triangles) {
  const TriangleSamples samples = triangle_samples(vertices, triangles);
  double bent = 0, right = 0, inward = 0;
  for (const auto& [ends, edge] : edges_of(triangles)) {
    if (edge.triangles[1] < 0) continue;
    const Eigen::Vector3d a = samples.normals.row(edge.triangles[0]), b = samples.normals.row(edge.triangles[1]);
    const double angle = std::acos(std::clamp(a.dot(b), -1.0, 1.0));
    if (angle < kFlatAngle) continue;
    const double length = (vertices.row(ends[0]) - vertices.row(ends[1])).norm();
    bent += length;
    if (std::abs(angle - std::numbers::pi / 2) > kNearRight) continue;
    right += length;
    const Eigen::Vector3d across = samples.centres.row(edge.triangles[1]) - samples.centres.row(edge.triangles[0]);
    if (a.dot(across) > 0) inward += length;
  }
  return bent > 0 && right > kRightAngles * bent ? inward / bent : 0;
}

bool is_staircase(const VertexArray& vertices, const TriangleArray& triangles) {
  return staircase_share(vertices, triangles) > kStaircase;
}

SparseMatrix surface_smoothing(const VertexArray& vertices, const TriangleArray& triangles) {
  SparseMatrix identity(vertices.rows(), vertices.rows());
  identity.setIdentity();
  if (!is_staircase(vertices, triangles)) return identity;
  std::vector<std::set<std::int32_t>> neighbours(static_cast<std::size_t>(vertices.rows()));
  for (const auto& [ends, edge] : edges_of(triangles))
    for (const int end : {0, 1})
      neighbours[static_cast<std::size_t>(ends[static_cast<std::size_t>(end)])].insert(
          ends[static_cast<std::size_t>(1 - end)]);
  std::vector<Eigen::Triplet<double>> entries;
  for (std::size_t v = 0; v < neighbours.size(); ++v)
    for (const auto other : neighbours[v]) {
      const double share = 1 / static_cast<double>(neighbours[v].size());
      entries.emplace_back(static_cast<int>(v), other, share);
      entries.emplace_back(static_cast<int>(v), static_cast<int>(v), -share);
    }
  SparseMatrix umbrella(vertices.rows(), vertices.rows());
  umbrella.setFromTriplets(entries.begin(), entries.end());
  const SparseMatrix step = (identity + kGrow * umbrella) * (identity + kShrink * umbrella);
  SparseMatrix result = step;
  for (int k = 1; k < kSmoothings; ++k) result = SparseMatrix(step * result);
  return result;
}

}  // namespace exmat::precompute
