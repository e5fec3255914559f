#pragma once

#include <Eigen/Core>

namespace exmat::runtime {

/// The point of a triangle nearest to a given one.
struct TrianglePoint {
  Eigen::Vector3d point = Eigen::Vector3d::Zero();
  Eigen::Vector3d barycentric = Eigen::Vector3d::Zero();  ///< exactly 0 off the edge or vertex that it is on
  double squared_distance = 0;
};

/// Ericson, Real-Time Collision Detection, 5.1.5. A triangle without area gives a point of one of its edges.
TrianglePoint nearest_on_triangle(const Eigen::Vector3d& point, const Eigen::Vector3d& a, const Eigen::Vector3d& b,
                                  const Eigen::Vector3d& c) noexcept;

}  // namespace exmat::runtime
