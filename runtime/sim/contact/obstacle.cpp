#include "runtime/sim/contact/obstacle.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <limits>

namespace exmat::runtime {
namespace {

SurfacePoint nearest(const Plane& plane, const Eigen::Vector3d& point, NearestHint& /*hint*/) {
  const double distance = plane.distance(point);
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

SurfacePoint nearest(const Sphere& sphere, const Eigen::Vector3d& point, NearestHint& /*hint*/) {
  return nearest_on_ball(sphere.centre, sphere.radius, Eigen::Vector3d::UnitZ(), point);
}

SurfacePoint nearest(const Capsule& capsule, const Eigen::Vector3d& point, NearestHint& hint) {
  const Eigen::Vector3d axis = capsule.end - capsule.start;
  const double square = axis.squaredNorm();
  if (square == 0) return nearest(Sphere{capsule.start, capsule.radius}, point, hint);
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

SurfacePoint nearest(const Box& box, const Eigen::Vector3d& point, NearestHint& /*hint*/) {
  const SurfacePoint local = nearest_in_axes(box.half_extents, box.rotation.transpose() * (point - box.centre));
  return {local.distance, box.rotation * local.normal, box.centre + box.rotation * local.point};
}

/// A point in a shape's own axes, and back.
template <class Placed>
Eigen::Vector3d in_axes_of(const Placed& shape, const Eigen::Vector3d& point) {
  return shape.rotation.transpose() * (point - shape.position);
}
template <class Placed>
SurfacePoint from_axes_of(const Placed& shape, const SurfacePoint& local) {
  return {local.distance, shape.rotation * local.normal, shape.position + shape.rotation * local.point};
}

SurfacePoint nearest(const MeshShape& shape, const Eigen::Vector3d& point, NearestHint& hint) {
  return from_axes_of(shape, shape.mesh->nearest(in_axes_of(shape, point), hint));
}

SurfacePoint nearest(const HeightFieldShape& shape, const Eigen::Vector3d& point, NearestHint& hint) {
  return from_axes_of(shape, shape.field->nearest(in_axes_of(shape, point), hint));
}

bool is_within(const MeshShape& shape, const Eigen::Vector3d& point, double radius) {
  return shape.mesh->may_be_within(in_axes_of(shape, point), radius);
}
bool is_within(const HeightFieldShape& shape, const Eigen::Vector3d& point, double radius) {
  return shape.field->may_be_within(in_axes_of(shape, point), radius);
}
template <class Solid>
bool is_within(const Solid& shape, const Eigen::Vector3d& point, double radius) {
  NearestHint hint;
  return nearest(shape, point, hint).distance <= radius;
}

/// The ray begins outside.
std::optional<double> entry_of(const Plane& plane, const Ray& ray, double /*most*/) {
  const double nears = -plane.normal.dot(ray.direction);
  return nears > 0 ? std::optional(plane.distance(ray.origin) / nears) : std::nullopt;
}
std::optional<double> entry_of(const Sphere& sphere, const Ray& ray, double /*most*/) {
  return ball_entry(ray, sphere.centre, sphere.radius);
}
std::optional<double> entry_of(const Capsule& capsule, const Ray& ray, double /*most*/) {
  return capsule_entry(ray, capsule.start, capsule.end, capsule.radius);
}
std::optional<double> entry_of(const Box& box, const Ray& ray, double /*most*/) {
  const Ray own{box.rotation.transpose() * (ray.origin - box.centre), box.rotation.transpose() * ray.direction};
  return box_entry(own, -box.half_extents, box.half_extents);
}
template <class Placed>
Ray in_axes_of(const Placed& shape, const Ray& ray) {
  return {in_axes_of(shape, ray.origin), shape.rotation.transpose() * ray.direction};
}
std::optional<double> entry_of(const MeshShape& shape, const Ray& ray, double most) {
  return shape.mesh->entry(in_axes_of(shape, ray), most);
}
std::optional<double> entry_of(const HeightFieldShape& shape, const Ray& ray, double most) {
  return shape.field->entry(in_axes_of(shape, ray), most);
}

double deepest_in(const Plane& /*plane*/) { return std::numeric_limits<double>::infinity(); }
double deepest_in(const Sphere& sphere) { return sphere.radius; }
double deepest_in(const Box& box) { return box.half_extents.minCoeff(); }
double deepest_in(const Capsule& capsule) { return capsule.radius; }
double deepest_in(const MeshShape& shape) { return shape.mesh->deepest(); }
double deepest_in(const HeightFieldShape& /*shape*/) { return std::numeric_limits<double>::infinity(); }

}  // namespace

SurfacePoint nearest_surface_point(const Shape& shape, const Eigen::Vector3d& point, NearestHint& hint) noexcept {
  return std::visit([&](const auto& held) { return nearest(held, point, hint); }, shape);
}

SurfacePoint nearest_surface_point(const Shape& shape, const Eigen::Vector3d& point) noexcept {
  if (const auto* mesh = std::get_if<MeshShape>(&shape))
    return from_axes_of(*mesh, mesh->mesh->nearest(in_axes_of(*mesh, point)));
  if (const auto* ground = std::get_if<HeightFieldShape>(&shape))
    return from_axes_of(*ground, ground->field->nearest(in_axes_of(*ground, point)));
  NearestHint hint;
  return nearest_surface_point(shape, point, hint);
}

double signed_distance(const Shape& shape, const Eigen::Vector3d& point) noexcept {
  return nearest_surface_point(shape, point).distance;
}

bool may_be_within(const Shape& shape, const Eigen::Vector3d& point, double radius) noexcept {
  return std::visit([&](const auto& held) { return is_within(held, point, radius); }, shape);
}

std::optional<double> entry(const Shape& shape, const Ray& ray, double most) noexcept {
  if (signed_distance(shape, ray.origin) < 0) return std::nullopt;
  const auto distance = std::visit([&](const auto& held) { return entry_of(held, ray, most); }, shape);
  return distance && *distance <= most ? distance : std::nullopt;
}

double deepest(const Shape& shape) noexcept {
  return std::visit([](const auto& held) { return deepest_in(held); }, shape);
}

double shortest_passage(const Shape& shape) noexcept {
  const bool is_known = !std::holds_alternative<MeshShape>(shape) && !std::holds_alternative<HeightFieldShape>(shape);
  return is_known ? 2 * deepest(shape) : 0;
}

bool PlacedObstacle::may_meet(const Eigen::Vector3d& centre, double radius, double margin) const noexcept {
  if (plane != nullptr) return plane->distance(centre) <= radius + margin;
  if (is_fixed) return may_be_within(obstacle->shape, centre, radius + margin);
  if (!sweeps) return may_be_within(obstacle->shape, pose.to_frame(centre), radius + margin);
  return may_be_within(obstacle->shape, start.to_frame(centre),
                       radius + margin + kContactMarginSteps * sweep(centre, radius));
}

SurfacePoint PlacedObstacle::nearest_surface_point(const Eigen::Vector3d& point, NearestHint& hint) const noexcept {
  if (plane != nullptr) return nearest(*plane, point, hint);
  if (is_fixed) return runtime::nearest_surface_point(obstacle->shape, point, hint);
  const SurfacePoint local = runtime::nearest_surface_point(obstacle->shape, pose.to_frame(point), hint);
  return {local.distance, pose.rotation * local.normal, pose.to_world(local.point)};
}

SurfacePoint PlacedObstacle::nearest_surface_point(const Eigen::Vector3d& point) const noexcept {
  const SurfacePoint local = runtime::nearest_surface_point(obstacle->shape, pose.to_frame(point));
  return {local.distance, pose.rotation * local.normal, pose.to_world(local.point)};
}

double PlacedObstacle::signed_distance(const Eigen::Vector3d& point) const noexcept {
  return runtime::signed_distance(obstacle->shape, pose.to_frame(point));
}

}  // namespace exmat::runtime
