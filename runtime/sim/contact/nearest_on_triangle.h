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
inline TrianglePoint nearest_on_triangle(const Eigen::Vector3d& point, const Eigen::Vector3d& a,
                                         const Eigen::Vector3d& b, const Eigen::Vector3d& c) noexcept {
  const auto at = [&](double u, double v, double w) {
    const Eigen::Vector3d on = u * a + v * b + w * c;
    return TrianglePoint{on, {u, v, w}, (point - on).squaredNorm()};
  };
  const Eigen::Vector3d ab = b - a, ac = c - a, ap = point - a;
  const double d1 = ab.dot(ap), d2 = ac.dot(ap);
  if (d1 <= 0 && d2 <= 0) return at(1, 0, 0);
  const Eigen::Vector3d bp = point - b;
  const double d3 = ab.dot(bp), d4 = ac.dot(bp);
  if (d3 >= 0 && d4 <= d3) return at(0, 1, 0);
  const Eigen::Vector3d cp = point - c;
  const double d5 = ab.dot(cp), d6 = ac.dot(cp);
  if (d6 >= 0 && d5 <= d6) return at(0, 0, 1);
  const double vc = d1 * d4 - d3 * d2;
  if (vc <= 0 && d1 >= 0 && d3 <= 0 && d1 > d3) return at(d3 / (d3 - d1), d1 / (d1 - d3), 0);
  const double vb = d5 * d2 - d1 * d6;
  if (vb <= 0 && d2 >= 0 && d6 <= 0 && d2 > d6) return at(d6 / (d6 - d2), 0, d2 / (d2 - d6));
  const double va = d3 * d6 - d5 * d4;
  if (va <= 0 && d4 >= d3 && d5 >= d6) {
    const double along = (d4 - d3) + (d5 - d6);
    return at(0, (d5 - d6) / along, (d4 - d3) / along);
  }
  const double sum = va + vb + vc;
  return at(va / sum, vb / sum, vc / sum);
}

}  // namespace exmat::runtime
