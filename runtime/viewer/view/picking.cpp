#include "runtime/viewer/view/picking.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <limits>

namespace exmat::viewer {
namespace {

Eigen::Vector3d point_of(std::span<const double> points, std::int32_t id) {
  return Eigen::Map<const Eigen::Vector3d>(points.data() + 3 * static_cast<std::ptrdiff_t>(id));
}

/// Shares of the nearest point of a segment.
Eigen::Vector2d nearest_of_segment(const Eigen::Vector3d& p, const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  const Eigen::Vector3d ab = b - a;
  const double square = ab.squaredNorm();
  const double t = square > 0 ? std::clamp((p - a).dot(ab) / square, 0.0, 1.0) : 0;
  return {1 - t, t};
}

Eigen::Vector3d nearest_shares(const Eigen::Vector3d& p, const Eigen::Matrix3d& corners) {
  const Eigen::Vector3d ab = corners.col(1) - corners.col(0), ac = corners.col(2) - corners.col(0);
  const Eigen::Vector3d normal = ab.cross(ac);
  if (normal.squaredNorm() > 0) {
    const Eigen::Vector3d from = p - corners.col(0);
    const double second = from.cross(ac).dot(normal) / normal.squaredNorm();
    const double third = ab.cross(from).dot(normal) / normal.squaredNorm();
    if (second >= 0 && third >= 0 && second + third <= 1) return {1 - second - third, second, third};
  }
  Eigen::Vector3d best = Eigen::Vector3d::UnitX();
  double least = std::numeric_limits<double>::infinity();
  for (int i = 0; i < 3; ++i) {
    const int j = (i + 1) % 3;
    Eigen::Vector3d shares = Eigen::Vector3d::Zero();
    const Eigen::Vector2d two = nearest_of_segment(p, corners.col(i), corners.col(j));
    shares[i] = two[0];
    shares[j] = two[1];
    const double distance = (corners * shares - p).squaredNorm();
    if (distance < least) {
      least = distance;
      best = shares;
    }
  }
  return best;
}

}  // namespace

SurfaceHit nearest_place(const Eigen::Vector3d& point, std::span<const double> points,
                         std::span<const std::int32_t> triangles) {
  SurfaceHit nearest{0, Eigen::Vector3d::UnitX(), std::numeric_limits<double>::infinity()};
  for (std::size_t i = 0; i + 2 < triangles.size(); i += 3) {
    Eigen::Matrix3d corners;
    for (std::size_t c = 0; c < 3; ++c) corners.col(static_cast<Eigen::Index>(c)) = point_of(points, triangles[i + c]);
    const Eigen::Vector3d shares = nearest_shares(point, corners);
    const double distance = (corners * shares - point).norm();
    if (distance < nearest.distance) nearest = {static_cast<std::int64_t>(i / 3), shares, distance};
  }
  return nearest;
}

}  // namespace exmat::viewer
