#include "runtime/sim/contact/ray.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace exmat::runtime {

/// Moeller and Trumbore 1997.
std::optional<TriangleHit> triangle_hit(const Ray& ray, const Eigen::Vector3d& a, const Eigen::Vector3d& b,
                                        const Eigen::Vector3d& c) noexcept {
  const Eigen::Vector3d ab = b - a, ac = c - a, from = ray.origin - a;
  const Eigen::Vector3d across = ray.direction.cross(ac), over = from.cross(ab);
  const double volume = ab.dot(across);
  if (volume == 0) return std::nullopt;
  const double second = from.dot(across) / volume, third = ray.direction.dot(over) / volume;
  const double distance = ac.dot(over) / volume;
  if (!(second >= 0 && third >= 0 && second + third <= 1 && distance >= 0)) return std::nullopt;
  return TriangleHit{{1 - second - third, second, third}, distance};
}

std::optional<double> box_entry(const Ray& ray, const Eigen::Vector3d& low, const Eigen::Vector3d& high) noexcept {
  double enters = 0, leaves = std::numeric_limits<double>::infinity();
  for (int axis = 0; axis < 3; ++axis) {
    if (ray.direction[axis] == 0) {
      if (ray.origin[axis] < low[axis] || ray.origin[axis] > high[axis]) return std::nullopt;
      continue;
    }
    double first = (low[axis] - ray.origin[axis]) / ray.direction[axis];
    double last = (high[axis] - ray.origin[axis]) / ray.direction[axis];
    if (first > last) std::swap(first, last);
    enters = std::max(enters, first);
    leaves = std::min(leaves, last);
  }
  return enters <= leaves ? std::optional(enters) : std::nullopt;
}

std::optional<double> ball_entry(const Ray& ray, const Eigen::Vector3d& centre, double radius) noexcept {
  const Eigen::Vector3d from = ray.origin - centre;
  const double half = from.dot(ray.direction);
  const double square = radius * radius - (from - half * ray.direction).squaredNorm();
  if (!(square >= 0)) return std::nullopt;
  const double distance = -half - std::sqrt(square);
  return distance >= 0 ? std::optional(distance) : std::nullopt;
}

/// By the balls at its ends and the cylinder between them.
std::optional<double> capsule_entry(const Ray& ray, const Eigen::Vector3d& start, const Eigen::Vector3d& end,
                                    double radius) noexcept {
  const std::optional<double> balls = nearer(ball_entry(ray, start, radius), ball_entry(ray, end, radius));
  const double length = (end - start).norm();
  if (length == 0) return balls;
  const Eigen::Vector3d unit = (end - start) / length, from = ray.origin - start;
  const Eigen::Vector3d slant = ray.direction - ray.direction.dot(unit) * unit, away = from - from.dot(unit) * unit;
  const double a = slant.squaredNorm(), half = away.dot(slant);
  const double square = half * half - a * (away.squaredNorm() - radius * radius);
  if (a == 0 || !(square >= 0)) return balls;
  const double distance = (-half - std::sqrt(square)) / a, along = (from + distance * ray.direction).dot(unit);
  return distance >= 0 && along >= 0 && along <= length ? nearer(balls, distance) : balls;
}

std::optional<double> nearer(std::optional<double> a, std::optional<double> b) noexcept {
  if (!a || !b) return a ? a : b;
  return std::min(*a, *b);
}

}  // namespace exmat::runtime
