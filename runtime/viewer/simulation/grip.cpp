#include "runtime/viewer/simulation/grip.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <set>
#include <vector>

namespace exmat::viewer {
namespace {

// The spring acts with the force of the step before. That is stable where it is slow against the step and the mass that
// the point feels at once.
constexpr double kStiffestPerStep = 0.1;  // k dt^2 / m
constexpr double kStiffest = 1e5;         // k / m [1/s^2]
constexpr double kDampingRatio = 0.6;
constexpr double kHandDelay = 0.03;  // [s] of the smoothed hand

Points point_on(const Surface& surface, const SurfaceHit& place) {
  const std::array<std::int64_t, 1> triangle{place.triangle};
  const std::array<double, 3> shares{place.shares.x(), place.shares.y(), place.shares.z()};
  return Points::on_surface(surface, triangle, shares);
}

}  // namespace

std::vector<Corner> covered_points(const BodyShape& shape, const SurfaceHit& place) {
  const Eigen::Vector3d centre = shape.rest_place(place);
  const double radius = kHandSize * shape.bounds.diagonal();
  std::set<std::int32_t> covered;
  std::vector<Corner> corners;
  for (std::int64_t triangle = 0; triangle < std::ssize(shape.triangles) / 3; ++triangle)
    for (int c = 0; c < 3; ++c)
      if ((shape.rest_corner(triangle, c) - centre).norm() <= radius && covered.insert(shape.point(triangle, c)).second)
        corners.push_back({triangle, c});
  return corners;
}

Points patch_of(const Surface& surface, const BodyShape& shape, const SurfaceHit& place) {
  std::vector<std::int64_t> triangles;
  std::vector<double> shares;
  for (const Corner& covered : covered_points(shape, place)) {
    triangles.push_back(covered.triangle);
    for (int c = 0; c < 3; ++c) shares.push_back(c == covered.corner ? 1 : 0);
  }
  return triangles.empty() ? point_on(surface, place) : Points::on_surface(surface, triangles, shares);
}

double effective_mass(const Points& points, const BodyShape& shape) {
  const std::vector<float> rows = points.basis(shape.modes);
  std::vector<double> mean(3 * shape.modes);
  for (std::size_t i = 0; i < rows.size(); ++i) mean[i % mean.size()] += rows[i] / static_cast<double>(points.size());
  double inverse = std::inner_product(mean.begin(), mean.end(), mean.begin(), 0.0) / 3;
  if (shape.mass > 0) inverse += 3 / shape.mass;
  return inverse > 0 ? 1 / inverse : 0;
}

Grip::Grip(int id, std::size_t body, const BodyShape& shape, const Surface& surface, const SurfaceHit& place,
           BodyRef& held)
    : id_(id),
      body_(body),
      place_(place),
      points_(point_on(surface, place)),
      patch_(patch_of(surface, shape, place)),
      effective_mass_(effective_mass(patch_, shape)),
      longest_(0.6 * shape.bounds.diagonal()) {
  follow(held);
}

Eigen::Vector3d Grip::read_point(BodyRef& held) const {
  std::array<float, 3> xyz{};
  held.read_positions(points_, xyz);
  return Eigen::Map<const Eigen::Vector3f>(xyz.data()).cast<double>();
}

void Grip::follow(BodyRef& held) {
  point_ = target_ = hand_ = read_point(held);
  force_.setZero();
}

double Grip::lost(const Capacity& capacity, const BodyRef& held) const {
  return capacity.lost(held, patch_, shared_force());
}

std::vector<double> Grip::shared_force() const {
  const Eigen::Vector3d each = force_ / static_cast<double>(patch_.size());
  std::vector<double> forces;
  for (std::size_t i = 0; i < patch_.size(); ++i) forces.insert(forces.end(), each.begin(), each.end());
  return forces;
}

void Grip::pull(double time_step, double strength, BodyRef& held) {
  const Eigen::Vector3d before = point_, hand_before = hand_;
  point_ = read_point(held);
  hand_ += (1 - std::exp(-time_step / kHandDelay)) * (target_ - hand_);
  const double per_mass = strength * std::min(kStiffest, kStiffestPerStep / (time_step * time_step));
  const double compliance = held.point_compliance(patch_);
  const double mass = compliance > 0 ? time_step * time_step / compliance : effective_mass_;
  const double stiffness = per_mass * mass;
  const double damping = 2 * kDampingRatio * std::sqrt(per_mass) * mass;
  Eigen::Vector3d reach = hand_ - point_;
  if (reach.norm() > longest_) reach *= longest_ / reach.norm();
  force_ = stiffness * reach + damping / time_step * ((hand_ - hand_before) - (point_ - before));
  held.apply_forces(patch_, shared_force());
}

}  // namespace exmat::viewer
