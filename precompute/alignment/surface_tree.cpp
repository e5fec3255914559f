#include "precompute/alignment/surface_tree.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>

namespace exmat::precompute {
namespace {

// Triangles tried for a nearest point in the metric of positions and normals.
constexpr Eigen::Index kFacingTriangles = 6;
// Triangles tried first, to bound the search for the nearest.
constexpr Eigen::Index kFirstTriangles = 3;

Eigen::Matrix3d corners_of(const VertexArray& vertices, const TriangleArray& triangles, Eigen::Index triangle) {
  Eigen::Matrix3d corners;
  for (int k = 0; k < 3; ++k) corners.row(k) = vertices.row(triangles(triangle, k));
  return corners;
}

SurfacePoint at(const Eigen::Matrix3d& corners, const Eigen::Vector3d& weights) {
  return {0, weights, corners.transpose() * weights};
}

RowMatrix with_normals(const TriangleSamples& samples) {
  RowMatrix points(samples.centres.rows(), 6);
  points << samples.centres, SurfaceTree::kNormalWeight * samples.normals;
  return points;
}

// Squared distances from the triangles' centres of one surface to another.
Eigen::VectorXd squared_distances(const SurfaceTree& from, const SurfaceTree& to) {
  const TriangleSamples& samples = from.samples();
  Eigen::VectorXd squared(samples.areas.size());
#pragma omp parallel for schedule(static)
  for (Eigen::Index k = 0; k < squared.size(); ++k) {
    const Eigen::Vector3d centre = samples.centres.row(k);
    squared[k] = (to.nearest(centre).position - centre).squaredNorm();
  }
  return squared;
}

double mean_squared_distance(const SurfaceTree& from, const SurfaceTree& to) {
  return squared_distances(from, to).dot(from.samples().areas) / from.samples().areas.sum();
}

}  // namespace

TriangleSamples triangle_samples(const VertexArray& vertices, const TriangleArray& triangles) {
  const Eigen::Index count = triangles.rows();
  TriangleSamples samples{VertexArray(count, 3), VertexArray(count, 3), Eigen::VectorXd(count)};
  for (Eigen::Index k = 0; k < count; ++k) {
    const Eigen::Matrix3d x = corners_of(vertices, triangles, k);
    const Eigen::Vector3d cross = (x.row(1) - x.row(0)).transpose().cross((x.row(2) - x.row(0)).transpose());
    samples.centres.row(k) = x.colwise().mean();
    samples.areas[k] = cross.norm() / 2;
    samples.normals.row(k) = samples.areas[k] > 0 ? Eigen::Vector3d(cross.normalized()) : Eigen::Vector3d::Zero();
  }
  return samples;
}

SurfacePoint nearest_on_triangle(const Eigen::Matrix3d& corners, const Eigen::Vector3d& point) {
  const Eigen::Vector3d a = corners.row(0), ab = corners.row(1) - corners.row(0), ac = corners.row(2) - corners.row(0);
  const Eigen::Vector3d ap = point - a, bp = ap - ab, cp = ap - ac;
  const double d1 = ab.dot(ap), d2 = ac.dot(ap);
  if (d1 <= 0 && d2 <= 0) return at(corners, {1, 0, 0});
  const double d3 = ab.dot(bp), d4 = ac.dot(bp);
  if (d3 >= 0 && d4 <= d3) return at(corners, {0, 1, 0});
  const double vc = d1 * d4 - d3 * d2;
  if (vc <= 0 && d1 >= 0 && d3 <= 0) return at(corners, {1 - d1 / (d1 - d3), d1 / (d1 - d3), 0});
  const double d5 = ab.dot(cp), d6 = ac.dot(cp);
  if (d6 >= 0 && d5 <= d6) return at(corners, {0, 0, 1});
  const double vb = d5 * d2 - d1 * d6;
  if (vb <= 0 && d2 >= 0 && d6 <= 0) return at(corners, {1 - d2 / (d2 - d6), 0, d2 / (d2 - d6)});
  const double va = d3 * d6 - d5 * d4;
  if (va <= 0 && d4 >= d3 && d5 >= d6) {
    const double share = (d4 - d3) / ((d4 - d3) + (d5 - d6));
    return at(corners, {0, 1 - share, share});
  }
  const double sum = va + vb + vc;
  return at(corners, {va / sum, vb / sum, vc / sum});
}

SurfaceTree::SurfaceTree(VertexArray vertices, TriangleArray triangles)
    : vertices_(std::move(vertices)),
      triangles_(std::move(triangles)),
      samples_(triangle_samples(vertices_, triangles_)),
      centres_(RowMatrix(samples_.centres)),
      centres_and_normals_(with_normals(samples_)) {
  for (Eigen::Index k = 0; k < triangles_.rows(); ++k) {
    const Eigen::Matrix3d corners = corners_of(vertices_, triangles_, k);
    const double radius = (corners.rowwise() - samples_.centres.row(k)).rowwise().norm().maxCoeff();
    largest_radius_ = std::max(largest_radius_, radius);
  }
}

SurfacePoint SurfaceTree::nearest_on(Eigen::Index triangle, const Eigen::Vector3d& point) const {
  SurfacePoint found = nearest_on_triangle(corners_of(vertices_, triangles_, triangle), point);
  found.triangle = triangle;
  return found;
}

SurfacePoint SurfaceTree::nearest(const Eigen::Vector3d& point) const {
  SurfacePoint best;
  double least = std::numeric_limits<double>::infinity();
  const auto offer = [&](const std::vector<std::int32_t>& triangles) {
    for (const Eigen::Index triangle : triangles) {
      const SurfacePoint candidate = nearest_on(triangle, point);
      const double squared = (candidate.position - point).squaredNorm();
      if (squared > least || (squared == least && triangle > best.triangle)) continue;
      least = squared;
      best = candidate;
    }
  };
  offer(centres_.nearest(point.data(), kFirstTriangles));
  // A triangle is at most its radius nearer than its centre: no other one can win.
  offer(centres_.within(point.data(), std::sqrt(least) + largest_radius_));
  return best;
}

SurfacePoint SurfaceTree::nearest_facing(const Eigen::Vector3d& point, const Eigen::Vector3d& normal) const {
  Eigen::Matrix<double, 6, 1> query;
  query << point, kNormalWeight * normal;
  SurfacePoint best;
  double least = std::numeric_limits<double>::infinity();
  for (const Eigen::Index triangle : centres_and_normals_.nearest(query.data(), kFacingTriangles)) {
    const SurfacePoint candidate = nearest_on(triangle, point);
    const double turned = kNormalWeight * (samples_.normals.row(triangle).transpose() - normal).norm();
    const double squared = (candidate.position - point).squaredNorm() + turned * turned;
    if (squared >= least) continue;
    least = squared;
    best = candidate;
  }
  return best;
}

double uncovered_share(const SurfaceTree& surface, const SurfaceTree& other, double distance) {
  const Eigen::VectorXd& areas = surface.samples().areas;
  const Eigen::VectorXd far = (squared_distances(surface, other).array() > distance * distance)
                                  .select(areas, Eigen::VectorXd::Zero(areas.size()));
  return far.sum() / areas.sum();
}

double two_way_chamfer(const SurfaceTree& a, const SurfaceTree& b) {
  return 0.5 * (mean_squared_distance(a, b) + mean_squared_distance(b, a));
}

}  // namespace exmat::precompute
