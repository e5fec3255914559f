#include "runtime/viewer/view/picking.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace exmat::viewer {
namespace {

template <typename Number>
Eigen::Vector3d point_of(std::span<const Number> points, std::int32_t id) {
  return Eigen::Map<const Eigen::Matrix<Number, 3, 1>>(points.data() + 3 * static_cast<std::ptrdiff_t>(id))
      .template cast<double>();
}

/// Moeller and Trumbore 1997.
std::optional<SurfaceHit> hit(const Ray& ray, const Eigen::Vector3d& a, const Eigen::Vector3d& b,
                              const Eigen::Vector3d& c) {
  const Eigen::Vector3d ab = b - a, ac = c - a, across = ray.direction.cross(ac);
  const double volume = ab.dot(across);
  if (volume == 0) return std::nullopt;
  const Eigen::Vector3d from = ray.origin - a;
  const double second = from.dot(across) / volume;
  const Eigen::Vector3d over = from.cross(ab);
  const double third = ray.direction.dot(over) / volume;
  const double distance = ac.dot(over) / volume;
  if (second < 0 || third < 0 || second + third > 1 || distance <= 0) return std::nullopt;
  return SurfaceHit{0, {1 - second - third, second, third}, distance};
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

std::optional<double> sphere_hit(const Ray& ray, const Eigen::Vector3d& centre, double radius) {
  const Eigen::Vector3d from = ray.origin - centre;
  const double half = from.dot(ray.direction), square = half * half - from.squaredNorm() + radius * radius;
  if (square < 0) return std::nullopt;
  const double distance = -half - std::sqrt(square);
  return distance > 0 ? std::optional(distance) : std::nullopt;
}

std::optional<double> box_hit(const Ray& ray, const Eigen::Vector3d& half) {
  double enter = 0, leave = std::numeric_limits<double>::infinity();
  for (int axis = 0; axis < 3; ++axis) {
    double first = (-half[axis] - ray.origin[axis]) / ray.direction[axis];
    double last = (half[axis] - ray.origin[axis]) / ray.direction[axis];
    if (first > last) std::swap(first, last);
    if (first > enter) enter = first;
    if (last < leave) leave = last;
  }
  return enter <= leave && enter > 0 ? std::optional(enter) : std::nullopt;
}

std::optional<double> nearer(std::optional<double> a, std::optional<double> b) {
  if (!a || !b) return a ? a : b;
  return std::min(*a, *b);
}

/// The balls at its ends and the cylinder between them.
std::optional<double> capsule_hit(const Ray& ray, const Eigen::Vector3d& start, const Eigen::Vector3d& axis,
                                  double radius) {
  std::optional<double> found = nearer(sphere_hit(ray, start, radius), sphere_hit(ray, start + axis, radius));
  const double length = axis.norm();
  if (length == 0) return found;
  const Eigen::Vector3d unit = axis / length, from = ray.origin - start;
  const Eigen::Vector3d d = ray.direction - ray.direction.dot(unit) * unit, o = from - from.dot(unit) * unit;
  const double a = d.squaredNorm(), half = o.dot(d), square = half * half - a * (o.squaredNorm() - radius * radius);
  if (a == 0 || square < 0) return found;
  const double distance = (-half - std::sqrt(square)) / a;
  const double along = (from + distance * ray.direction).dot(unit);
  return distance > 0 && along >= 0 && along <= length ? nearer(found, distance) : found;
}

std::optional<double> triangles_hit(const Ray& ray, std::span<const double> corners) {
  std::optional<double> first;
  for (std::size_t i = 0; i + 8 < corners.size(); i += 9) {
    const auto corner = [&](std::size_t c) { return Eigen::Vector3d(corners.data() + i + 3 * c); };
    if (const auto found = hit(ray, corner(0), corner(1), corner(2))) first = nearer(first, found->distance);
  }
  return first;
}

}  // namespace

std::optional<SurfaceHit> first_hit(const Ray& ray, std::span<const float> points,
                                    std::span<const std::int32_t> triangles) {
  std::optional<SurfaceHit> first;
  for (std::size_t i = 0; i + 2 < triangles.size(); i += 3) {
    std::optional<SurfaceHit> found = hit(ray, point_of(points, triangles[i]), point_of(points, triangles[i + 1]),
                                          point_of(points, triangles[i + 2]));
    if (!found || (first && first->distance <= found->distance)) continue;
    found->triangle = static_cast<std::int64_t>(i / 3);
    first = found;
  }
  return first;
}

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

std::optional<double> obstacle_hit(const Ray& ray, const exmat_obstacle& obstacle, std::span<const double> corners,
                                   const exmat_motion& motion) {
  const Eigen::Quaterniond turn(motion.orientation[0], motion.orientation[1], motion.orientation[2],
                                motion.orientation[3]);
  const Eigen::Quaterniond back = turn.conjugate();
  const Ray own{back * (ray.origin - Eigen::Vector3d(motion.position)), back * ray.direction};
  const Eigen::Vector3d point(obstacle.point);
  switch (obstacle.shape) {
    case EXMAT_SPHERE:
      return sphere_hit(own, point, obstacle.radius);
    case EXMAT_CAPSULE:
      return capsule_hit(own, point, Eigen::Vector3d(obstacle.direction), obstacle.radius);
    case EXMAT_BOX: {
      const Eigen::Quaterniond box(obstacle.orientation[0], obstacle.orientation[1], obstacle.orientation[2],
                                   obstacle.orientation[3]);
      return box_hit({box.conjugate() * (own.origin - point), box.conjugate() * own.direction},
                     Eigen::Vector3d(obstacle.half_extents));
    }
    default:
      return triangles_hit(own, corners);
  }
}

}  // namespace exmat::viewer
