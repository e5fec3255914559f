#include "runtime/sim/contact/obstacle.h"

#include <Eigen/Geometry>
#include <algorithm>

namespace exmat::runtime {
namespace {

SurfacePoint nearest(const Plane& plane, const Eigen::Vector3d& point) {
  const double distance = plane.normal.dot(point - plane.point);
  return {distance, plane.normal, point - distance * plane.normal};
}

/// On the ball about `centre`; `fallback` is its normal at the centre.
SurfacePoint nearest_on_ball(const Eigen::Vector3d& centre, double radius, const Eigen::Vector3d& fallback,
                             const Eigen::Vector3d& point) {
  const Eigen::Vector3d offset = point - centre;
  const double length = offset.norm();
  const Eigen::Vector3d normal = length > 0 ? Eigen::Vector3d(offset / length) : fallback;
  return {length - radius, normal, centre + radius * normal};
}

SurfacePoint nearest(const Sphere& sphere, const Eigen::Vector3d& point) {
  return nearest_on_ball(sphere.centre, sphere.radius, Eigen::Vector3d::UnitZ(), point);
}

SurfacePoint nearest(const Capsule& capsule, const Eigen::Vector3d& point) {
  const Eigen::Vector3d axis = capsule.end - capsule.start;
  const double square = axis.squaredNorm();
  if (square == 0) return nearest(Sphere{capsule.start, capsule.radius}, point);
  const double along = std::clamp(axis.dot(point - capsule.start) / square, 0.0, 1.0);
  return nearest_on_ball(capsule.start + along * axis, capsule.radius, axis.unitOrthogonal(), point);
}

SurfacePoint nearest_in_axes(const Eigen::Vector3d& half_extents, const Eigen::Vector3d& point) {
  const Eigen::Vector3d clamped = point.cwiseMax(-half_extents).cwiseMin(half_extents);
  const Eigen::Vector3d outside = point - clamped;
  const double distance = outside.norm();
  if (distance > 0) return {distance, outside / distance, clamped};
  Eigen::Index axis = 0;
  const double depth = (half_extents - point.cwiseAbs()).minCoeff(&axis);
  const double side = point[axis] < 0 ? -1 : 1;
  SurfacePoint surface{-depth, side * Eigen::Vector3d::Unit(axis), point};
  surface.point[axis] = side * half_extents[axis];
  return surface;
}

SurfacePoint nearest(const Box& box, const Eigen::Vector3d& point) {
  const SurfacePoint local = nearest_in_axes(box.half_extents, box.rotation.transpose() * (point - box.centre));
  return {local.distance, box.rotation * local.normal, box.centre + box.rotation * local.point};
}

}  // namespace

SurfacePoint nearest_surface_point(const Shape& shape, const Eigen::Vector3d& point) noexcept {
  return std::visit([&point](const auto& held) { return nearest(held, point); }, shape);
}

double signed_distance(const Shape& shape, const Eigen::Vector3d& point) noexcept {
  return nearest_surface_point(shape, point).distance;
}

SurfacePoint PlacedObstacle::nearest_surface_point(const Eigen::Vector3d& point) const noexcept {
  const SurfacePoint local = runtime::nearest_surface_point(obstacle->shape, pose.to_frame(point));
  return {local.distance, pose.rotation * local.normal, pose.to_world(local.point)};
}

double PlacedObstacle::signed_distance(const Eigen::Vector3d& point) const noexcept {
  return runtime::signed_distance(obstacle->shape, pose.to_frame(point));
}

}  // namespace exmat::runtime
