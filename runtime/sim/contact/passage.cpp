#include "runtime/sim/contact/passage.h"

#include <Eigen/Geometry>

#include "runtime/sim/contact/first_meeting.h"

namespace exmat::runtime {
namespace {

constexpr double kDeep = 0.5;      // of the deepest: from here on it is held to the side that it came in by
constexpr double kNearest = 1.25;  // of the nearest distance: the way out is the nearest again
constexpr double kSameSide = 0.5;  // cosine
constexpr double kBegun = 0.5;     // of the depth: a way inward that may end on another side
constexpr double kBeyond = 1e-3;   // of the way out, to begin outside
constexpr double kSunk = 0.1;      // of the deepest: what is put there goes the way of its body
constexpr int kMostDoublings = 64;

/// True if a vertex that came in by `side` has left it, where its nearest point is `there`.
bool has_passed(const SidePlane& side, const SurfacePoint& there, const Eigen::Vector3d& point) {
  if (side.nearest(point).distance >= 0) return false;
  return there.distance > 0 || there.normal.dot(side.normal) < kOtherSide;
}

Passage passage_by(const PlacedObstacle& placed, const SidePlane& side, const Eigen::Vector3d& predicted) {
  const bool passes = has_passed(side, placed.nearest_surface_point(predicted), predicted);
  return {passes ? Passage::Kind::kThrough : Passage::Kind::kWatched, side};
}

/// Passage of a vertex that begins inside.
Passage passage_from_inside(const PlacedObstacle& placed, const VertexWay& way, const SurfacePoint& nearest) {
  const Shape& shape = placed.obstacle->shape;
  const SidePlane side{nearest.point, nearest.normal};
  const double depth = -nearest.distance, inward = -side.normal.dot(way.predicted - way.carried);
  if (depth > kDeep * deepest(shape)) return {Passage::Kind::kThrough, side};
  if (inward > kBegun * depth && inward > kFast * shortest_passage(shape))
    return passage_by(placed, side, way.predicted);
  return {Passage::Kind::kWatched, side};
}

/// True if the surface that a vertex came in by is the nearest again, and not far.
bool is_back(const PlacedObstacle& placed, const SurfacePoint& nearest, const Eigen::Vector3d& way_out) {
  const double length = way_out.norm();
  return nearest.distance < 0 && nearest.normal.dot(way_out) > kSameSide * length &&
         length <= -kNearest * nearest.distance && length <= kDeep * deepest(placed.obstacle->shape);
}

}  // namespace

std::optional<SidePlane> first_entry(const PlacedObstacle& placed, const Eigen::Vector3d& from,
                                     const Eigen::Vector3d& to) noexcept {
  const auto met = first_meeting(from, to, [&](const Eigen::Vector3d& point, double /*left*/) {
    return std::optional(placed.nearest_surface_point(point));
  });
  return met ? std::optional(SidePlane{met->point, met->normal}) : std::nullopt;
}

Passage find_passage(const PlacedObstacle& placed, const VertexWay& way, const SurfacePoint& nearest,
                     const Eigen::Vector3d& way_out) noexcept {
  if (std::holds_alternative<Plane>(placed.obstacle->shape)) return {};  // it has one side
  if (!way_out.isZero(0) && !is_back(placed, nearest, way_out)) {
    // The surface may be curved, or end beside the vertex: then nothing is between it and where it came from.
    const auto entry = first_entry(placed, way.carried + (1 + kBeyond) * way_out, way.carried);
    if (entry) return {Passage::Kind::kThrough, *entry};
  }
  if (nearest.distance <= 0) return passage_from_inside(placed, way, nearest);
  const double reach = (way.heading - way.carried).norm();
  if (reach <= kFast * shortest_passage(placed.obstacle->shape) || reach < nearest.distance) return {};
  const auto entry = first_entry(placed, way.carried, way.heading);
  return entry ? passage_by(placed, *entry, way.predicted) : Passage{};
}

Eigen::Vector3d way_out_with(const Eigen::Vector3d& centre, const PlacedObstacle& placed,
                             const Eigen::Vector3d& carried, const SurfacePoint& nearest) noexcept {
  if (!(-nearest.distance > kSunk * deepest(placed.obstacle->shape))) return Eigen::Vector3d::Zero();
  const SurfacePoint out = placed.nearest_surface_point(centre);
  if (out.distance >= 0) return Eigen::Vector3d::Zero();
  Eigen::Vector3d way = -2 * nearest.distance * out.normal;
  for (int i = 0; i < kMostDoublings && placed.nearest_surface_point(carried + way).distance <= 0; ++i) way *= 2;
  return way;
}

SurfacePoint felt_surface(const PlacedObstacle& placed, const Passage& passage, const Eigen::Vector3d& point,
                          NearestHint& hint, bool& by_plane) noexcept {
  by_plane = passage.kind == Passage::Kind::kThrough;
  if (by_plane) return passage.side.nearest(point);
  const SurfacePoint nearest = placed.nearest_surface_point(point, hint);
  if (passage.kind == Passage::Kind::kNearest || nearest.normal.dot(passage.side.normal) >= kOtherSide) return nearest;
  const SurfacePoint beside = passage.side.nearest(point);
  if (beside.distance >= 0) return nearest;
  by_plane = true;
  return beside;
}

}  // namespace exmat::runtime
