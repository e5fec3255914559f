#include "runtime/viewer/simulation/grip.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

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

/// The inverse of how much an impulse on the point moves it, by the modes and by rigid motion.
double effective_mass(const Points& points, const BodyShape& shape) {
  const std::vector<float> rows = points.basis(shape.modes);
  double inverse = std::inner_product(rows.begin(), rows.end(), rows.begin(), 0.0) / 3;
  if (shape.mass > 0) inverse += 3 / shape.mass;
  return inverse > 0 ? 1 / inverse : 0;
}

}  // namespace

Grip::Grip(int id, std::size_t body, const BodyShape& shape, const Surface& surface, const SurfaceHit& place,
           BodyRef& held)
    : id_(id),
      body_(body),
      place_(place),
      points_(point_on(surface, place)),
      effective_mass_(effective_mass(points_, shape)),
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
  return capacity.lost(held, points_, std::array{force_.x(), force_.y(), force_.z()});
}

void Grip::pull(double time_step, double strength, BodyRef& held) {
  const Eigen::Vector3d before = point_, hand_before = hand_;
  point_ = read_point(held);
  hand_ += (1 - std::exp(-time_step / kHandDelay)) * (target_ - hand_);
  const double per_mass = strength * std::min(kStiffest, kStiffestPerStep / (time_step * time_step));
  const double stiffness = per_mass * effective_mass_;
  const double damping = 2 * kDampingRatio * std::sqrt(per_mass) * effective_mass_;
  Eigen::Vector3d reach = hand_ - point_;
  if (reach.norm() > longest_) reach *= longest_ / reach.norm();
  force_ = stiffness * reach + damping / time_step * ((hand_ - hand_before) - (point_ - before));
  held.apply_forces(points_, std::array{force_.x(), force_.y(), force_.z()});
}

}  // namespace exmat::viewer
