#include <Eigen/Geometry>
#include <algorithm>
#include <cinttypes>
#include <optional>
#include <vector>

#include "exmat/exmat.h"
#include "runtime/api/arguments.h"
#include "runtime/api/world_handle.h"
#include "runtime/sim/contact/ray.h"

using namespace exmat;           // NOLINT(google-build-using-namespace)
using namespace exmat::runtime;  // NOLINT(google-build-using-namespace)

namespace {

/// The first triangle that a ray meets; -1: none.
struct Hit {
  Eigen::Index triangle = -1;
  Eigen::Vector3d shares = Eigen::Vector3d::Zero(), normal = Eigen::Vector3d::Zero();
  double distance = 0;  ///< [m]
};

/// Casts a ray through triangles whose corners are at `xyz` [3k], world [m], no farther than `most` [m].
Hit first_hit(const TriangleArray& triangles, const std::vector<double>& xyz, const Ray& ray, double most) {
  const auto corner = [&](Eigen::Index triangle, int c) {
    return Eigen::Map<const Eigen::Vector3d>(xyz.data() + 3 * static_cast<Eigen::Index>(triangles(triangle, c)));
  };
  Hit first;
  first.distance = most;
  for (Eigen::Index k = 0; k < triangles.rows(); ++k) {
    const Eigen::Vector3d a = corner(k, 0), b = corner(k, 1), c = corner(k, 2);
    const std::optional<TriangleHit> hit = triangle_hit(ray, a, b, c);
    if (hit && hit->distance <= first.distance)
      first = {k, hit->shares, (b - a).cross(c - a).normalized(), hit->distance};
  }
  return first;
}

/// Checks and reads a caller's ray.
exmat_status read_ray(const char* function, const double* origin, const double* direction, double most,
                      Ray& ray) noexcept {
  if (origin == nullptr) return null_argument(function, "origin");
  if (direction == nullptr) return null_argument(function, "direction");
  if (find_far(origin, 3) != nullptr || find_far(direction, 3) != nullptr || !(most >= 0))
    return fail(EXMAT_INVALID_ARGUMENT,
                "%s: expected an origin and a direction of numbers within 1e30, and a distance >= 0", function);
  ray = {Eigen::Map<const Eigen::Vector3d>(origin), Eigen::Map<const Eigen::Vector3d>(direction).stableNormalized()};
  if (!(ray.direction.norm() > 0.5))
    return fail(EXMAT_INVALID_ARGUMENT, "%s: direction: expected one that is not 0", function);
  return EXMAT_OK;
}

/// Casts the ray through a surface of the body, where it is now. `xyz` is scratch.
Hit first_hit(const exmat_body& body, const exmat_surface& surface, const Ray& ray, double most,
              std::vector<double>& xyz) {
  const PointSet& points = surface.points.set;
  xyz.resize(static_cast<std::size_t>(points.rest.size()));
  const Placement placement = body.model().frame->placement(body.state.frame);
  for (Eigen::Index i = 0; i < points.rest.rows(); ++i)
    Eigen::Map<Eigen::Vector3d>(xyz.data() + 3 * i) = world_position(points, i, body, placement);
  return first_hit(surface.drawn.triangles, xyz, ray, most);
}

/// Distance at which the ray enters the box about the surface: no hit is nearer [m]. None where it misses the box; 0 of
/// a body in all its vertices, which has none.
std::optional<double> nearest_possible(const exmat_body& body, const exmat_surface& surface, const Ray& ray) noexcept {
  if (body.state.full) return 0;
  const Placement placement = body.model().frame->placement(body.state.frame);
  const Eigen::Matrix3d back = placement.rotation.transpose();
  const Ray own{back * (ray.origin - placement.to_world(Eigen::Vector3d::Zero())), back * ray.direction};
  const Eigen::AlignedBox3d box = surface.box.at(body.state.q);
  return box_entry(own, box.min(), box.max());
}

/// Looks for an obstacle that the ray enters before `first`.
void cast_through_obstacles(const exmat_world& world, const Ray& ray, exmat_ray_hit& first) {
  for (const exmat_world::HostedObstacle& each : world.obstacles) {
    const MotionSample pose = each.obstacle->motion.sample(time_of(world));
    const Ray own{pose.to_frame(ray.origin), pose.rotation.transpose() * ray.direction};
    const std::optional<double> distance = entry(each.obstacle->shape, own, first.distance);
    if (!distance || *distance >= first.distance) continue;
    first = {};
    first.body = first.surface = first.triangle = -1;
    first.distance = *distance;
    Eigen::Map<Eigen::Vector3d>{first.normal} =
        pose.rotation * nearest_surface_point(each.obstacle->shape, own.at(*distance)).normal;
    first.obstacle = each.id;
  }
}

}  // namespace

exmat_status exmat_body_cast_ray(const exmat_body* body, const exmat_surface* surface, const double* origin,
                                 const double* direction, double most, std::int64_t* triangle, double* shares,
                                 double* distance, double* normal) noexcept {
  EXMAT_REQUIRE(body);
  EXMAT_REQUIRE(surface);
  EXMAT_REQUIRE(triangle);
  *triangle = -1;
  Ray ray;
  if (const exmat_status status = read_ray(__func__, origin, direction, most, ray)) return status;
  if (surface->points.source != body->source)
    return fail(EXMAT_INVALID_ARGUMENT, "%s: the surface is that of another model", __func__);
  return guarded(__func__, [&] {
    const std::optional<double> possible = nearest_possible(*body, *surface, ray);
    if (!possible || *possible > most) return;
    std::vector<double> xyz;
    const Hit hit = first_hit(*body, *surface, ray, most, xyz);
    if (hit.triangle < 0) return;
    *triangle = hit.triangle;
    if (shares != nullptr) Eigen::Map<Eigen::Vector3d>{shares} = hit.shares;
    if (distance != nullptr) *distance = hit.distance;
    if (normal != nullptr) Eigen::Map<Eigen::Vector3d>{normal} = hit.normal;
  });
}

exmat_status exmat_world_cast_ray(const exmat_world* world, const exmat_surface* const* surfaces, std::int64_t count,
                                  const double* origin, const double* direction, double most,
                                  exmat_ray_hit* hit) noexcept {
  EXMAT_REQUIRE(world);
  EXMAT_REQUIRE(hit);
  if (const exmat_status status = check_size(__func__, hit->size, kRayHitSizes)) return status;
  if (count < 0) return fail(EXMAT_INVALID_ARGUMENT, "%s: count = %" PRId64 ": expected >= 0", __func__, count);
  if (count > 0) EXMAT_REQUIRE(surfaces);
  for (std::int64_t i = 0; i < count; ++i)
    if (surfaces[i] == nullptr) return fail(EXMAT_INVALID_ARGUMENT, "%s: surfaces[%" PRId64 "] is NULL", __func__, i);
  Ray ray;
  if (const exmat_status status = read_ray(__func__, origin, direction, most, ray)) return status;
  return guarded(__func__, [&] {
    struct Candidate {
      double distance = 0;  // [m], of nearest_possible()
      const exmat_world::Member* member = nullptr;
      std::int64_t surface = 0;
    };
    std::vector<Candidate> candidates;
    for (const exmat_world::Member& member : world->members)
      for (std::int64_t i = 0; i < count; ++i)
        if (surfaces[i]->points.source == member.body->source)
          if (const auto distance = nearest_possible(*member.body, *surfaces[i], ray); distance && *distance <= most)
            candidates.push_back({*distance, &member, i});
    std::ranges::stable_sort(candidates, {}, &Candidate::distance);
    exmat_ray_hit first{};
    first.body = first.surface = first.triangle = first.obstacle = -1;
    first.distance = most;
    std::vector<double> xyz;
    for (const Candidate& candidate : candidates) {
      if (candidate.distance > first.distance) break;
      const Hit found = first_hit(*candidate.member->body, *surfaces[candidate.surface], ray, first.distance, xyz);
      if (found.triangle < 0) continue;
      first.body = candidate.member->id;
      first.surface = candidate.surface;
      first.triangle = found.triangle;
      first.distance = found.distance;
      std::copy_n(found.shares.data(), 3, first.shares);
      std::copy_n(found.normal.data(), 3, first.normal);
    }
    if (hit->size > kRayHitSizes.first) cast_through_obstacles(*world, ray, first);
    if (first.body < 0 && first.obstacle < 0) first.distance = 0;
    give(first, hit->size, hit);
  });
}
