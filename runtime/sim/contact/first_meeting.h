#pragma once

#include <Eigen/Core>
#include <algorithm>

namespace exmat::runtime {

/// First meeting with a surface on the way between two places, the first outside, by steps as long as the distance
/// (conservative advancement, Mirtich 1996): to a thousandth of the way. `nearest(point, left)` is an optional, with
/// `distance` and `normal`, of what is within `left` [m] of a point. Empty where the way meets nothing.
template <class Nearest>
auto first_meeting(const Eigen::Vector3d& from, const Eigen::Vector3d& to, const Nearest& nearest) {
  constexpr int kMostAdvances = 64;
  constexpr double kTouching = 1e-3;      // of the way: near enough for the plane there to be the surface
  constexpr double kLeastAdvance = 1e-3;  // of the way, along a surface that it does not come nearer to
  using Found = decltype(nearest(from, 0.0));
  const Eigen::Vector3d way = to - from;
  const double length = way.norm();
  double gone = 0;  // of the length
  for (int i = 0; i < kMostAdvances && length > 0 && gone <= length; ++i) {
    Found here = nearest(Eigen::Vector3d(from + gone / length * way), length - gone);
    if (!here) break;
    const double approach = -here->normal.dot(way) / length;
    if (here->distance <= kTouching * length && approach > 0 && here->distance <= approach * (length - gone))
      return here;
    gone += std::max(here->distance, kLeastAdvance * length);
  }
  return Found();
}

}  // namespace exmat::runtime
