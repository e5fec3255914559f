#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>

namespace exmat::viewer {

/// A point of a triangle that a ray meets.
struct SurfaceHit {
  std::int64_t triangle = 0;
  Eigen::Vector3d shares = Eigen::Vector3d::Zero();  ///< shares of its corners, sum 1
  double distance = 0;                               ///< along the ray [m]
};

/// The place on triangles [3f] of points [3k] that is nearest to `point`; distance is that between them.
SurfaceHit nearest_place(const Eigen::Vector3d& point, std::span<const double> points,
                         std::span<const std::int32_t> triangles);

}  // namespace exmat::viewer
