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

}  // namespace exmat::runtime
