#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <span>

#include "exmat/exmat.h"
#include "runtime/viewer/view/camera.h"

namespace exmat::viewer {

/// A point of a triangle that a ray meets.
struct SurfaceHit {
  std::int64_t triangle = 0;
  Eigen::Vector3d shares = Eigen::Vector3d::Zero();  ///< shares of its corners, sum 1
  double distance = 0;                               ///< along the ray [m]
};

/// The first of triangles [3f] of points [3k] that the ray meets.
std::optional<SurfaceHit> first_hit(const Ray& ray, std::span<const float> points,
                                    std::span<const std::int32_t> triangles);

/// The place on triangles [3f] of points [3k] that is nearest to `point`; distance is that between them.
SurfaceHit nearest_place(const Eigen::Vector3d& point, std::span<const double> points,
                         std::span<const std::int32_t> triangles);

/// Distance to where the ray enters an obstacle at `motion`, world; none of planes. `corners` [9f] of a mesh or ground.
std::optional<double> obstacle_hit(const Ray& ray, const exmat_obstacle& obstacle, std::span<const double> corners,
                                   const exmat_motion& motion);

}  // namespace exmat::viewer
