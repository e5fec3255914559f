#pragma once

#include <Eigen/Core>

namespace exmat::runtime {

/// The point of a surface nearest to a given one.
struct SurfacePoint {
  double distance = 0;                                ///< to the given point, negative inside [m]
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();  ///< unit, outward: the gradient of the distance; where there is
                                                      ///< none (edges, centres), the same one of several each time
  Eigen::Vector3d point = Eigen::Vector3d::Zero();
};

/// Hint that a search for a nearest point leaves to the next one nearby: its triangle, and how near no other is. Saves
/// time alone: results do not depend on it.
struct NearestHint {
  int triangle = -1;  ///< -1: none
  double others = 0;  ///< all others are as far from `from` as this, or farther [m]
  Eigen::Vector3d from = Eigen::Vector3d::Zero();

  /// True if a triangle whose distance from `point` is `distance` is the nearest alone.
  bool holds(const Eigen::Vector3d& point, double distance) const noexcept {
    const double room = others - distance;
    return room > 0 && (point - from).squaredNorm() < room * room;
  }
};

}  // namespace exmat::runtime
