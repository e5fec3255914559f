#include "runtime/sim/contact/near_planes.h"

#include <algorithm>
#include <limits>

namespace exmat::runtime {
namespace {

constexpr double kPlaneMargins = 2;   // beyond what a step needs: some steps of what it moves by,
constexpr double kPlaneShare = 2e-3;  // and of the body's size: many steps of one that hardly moves
constexpr int kPlaneWorthwhile = 3;   // steps that a search has to serve
constexpr int kPlaneWithout = 16;     // steps without, after one that did not
constexpr double kPlaneRounding = 16 * std::numeric_limits<double>::epsilon();  // of where a vertex is

bool is_same(const Plane& a, const Plane& b) { return a.normal == b.normal && a.point == b.point; }

}  // namespace

NearPlanes::NearPlanes(Eigen::Index vertices, Eigen::Index modes, std::size_t obstacles)
    : obstacles_(obstacles),
      planes_(obstacles),
      ways_(obstacles),
      vertices_(static_cast<std::size_t>(vertices)),
      distances_(vertices_.size() * obstacles),
      q_(modes) {}

bool NearPlanes::serve(std::span<const PlacedObstacle> obstacles) noexcept {
  return std::ranges::all_of(obstacles, [](const PlacedObstacle& placed) { return placed.plane != nullptr; });
}

bool NearPlanes::knows(std::span<const PlacedObstacle> obstacles, const Pose& pose, double margin) noexcept {
  if (radius_ < 0 || obstacles.size() != obstacles_) return false;
  const Eigen::Vector3d moved = pose.placement.position - placement_.position;
  const Eigen::Matrix3d turned = (pose.placement.rotation - placement_.rotation).transpose();
  const double farthest = pose.reach + pose.movement.of(pose.q);
  const double deformed = pose.movement.of(pose.q - q_) + kPlaneRounding * (pose.placement.position.norm() + farthest);
  double longest = 0;
  for (std::size_t i = 0; i < obstacles_; ++i) {
    const Plane& plane = *obstacles[i].plane;
    if (!is_same(plane, planes_[i])) return false;
    ways_[i] = (turned * plane.normal).norm() * farthest + deformed - plane.normal.dot(moved);
    longest = std::max(longest, ways_[i]);
  }
  if (!(margin + longest <= radius_)) return false;
  ++served_;
  return true;
}

bool NearPlanes::is_worthwhile() noexcept {
  if (radius_ >= 0 && served_ < kPlaneWorthwhile) without_ = kPlaneWithout;
  radius_ = -1;
  if (without_ == 0) return true;
  --without_;
  return false;
}

void NearPlanes::begin(std::span<const PlacedObstacle> obstacles, const Pose& pose, double margin) noexcept {
  for (std::size_t i = 0; i < obstacles_; ++i) planes_[i] = *obstacles[i].plane;
  placement_ = pose.placement;
  q_ = pose.q;
  radius_ = (1 + kPlaneMargins) * margin + kPlaneShare * pose.reach;
  count_ = 0;
  served_ = 0;
}

void NearPlanes::add(int vertex, std::span<const PlacedObstacle> obstacles, const Eigen::Vector3d& point) noexcept {
  double* distances = distances_.data() + count_ * obstacles_;
  bool is_near = false;
  for (std::size_t i = 0; i < obstacles_; ++i) {
    distances[i] = obstacles[i].plane->distance(point);
    is_near = is_near || distances[i] <= radius_;
  }
  if (is_near) vertices_[count_++] = vertex;
}

bool NearPlanes::may_be_near(std::size_t index, double margin) const noexcept {
  const double* distances = distances_.data() + index * obstacles_;
  for (std::size_t i = 0; i < obstacles_; ++i)
    if (distances[i] - ways_[i] <= margin) return true;
  return false;
}

}  // namespace exmat::runtime
