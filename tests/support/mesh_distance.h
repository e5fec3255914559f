#pragma once

#include <Eigen/Geometry>
#include <cmath>
#include <limits>
#include <numbers>

#include "common/core/arrays.h"
#include "runtime/sim/contact/nearest_on_triangle.h"

namespace exmat::test {

/// Solid angle of a surface over 4 pi: 1 inside, 0 outside (van Oosterom and Strackee 1983).
inline double winding_number(const VertexArray& x, const TriangleArray& triangles, const Eigen::Vector3d& p) {
  double sum = 0;
  for (Eigen::Index t = 0; t < triangles.rows(); ++t) {
    const Eigen::Vector3d a = x.row(triangles(t, 0)).transpose() - p, b = x.row(triangles(t, 1)).transpose() - p,
                          c = x.row(triangles(t, 2)).transpose() - p;
    sum += 2 * std::atan2(a.dot(b.cross(c)), a.norm() * b.norm() * c.norm() + a.dot(b) * c.norm() +
                                                 b.dot(c) * a.norm() + c.dot(a) * b.norm());
  }
  return sum / (4 * std::numbers::pi);
}

/// Distance of the nearest of all triangles.
inline double distance_to_all(const VertexArray& x, const TriangleArray& triangles, const Eigen::Vector3d& p) {
  double nearest = std::numeric_limits<double>::infinity();
  for (Eigen::Index t = 0; t < triangles.rows(); ++t)
    nearest = std::min(
        nearest, runtime::nearest_on_triangle(p, x.row(triangles(t, 0)), x.row(triangles(t, 1)), x.row(triangles(t, 2)))
                     .squared_distance);
  return std::sqrt(nearest);
}

}  // namespace exmat::test
