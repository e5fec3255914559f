#pragma once

#include <cmath>
#include <limits>

namespace exmat {

/// Largest number in places [m], velocities [m/s], forces [N] and all else that a user gives: squares are finite, and
/// places fit into single precision.
inline constexpr double kFarthest = 1e30;

/// False for NaN, too.
inline bool is_near(double number) noexcept { return std::abs(number) <= kFarthest; }

/// How far apart numbers of 16 digits are `far` from the origin, where that is more than solvers ask for of a body so
/// long; else 0 [m].
inline double lost_detail(double far, double length) noexcept {
  constexpr double kLostShare = 1e-9;  // of the length, by rounding
  const double gap = far * std::numeric_limits<double>::epsilon();
  return gap > kLostShare * length ? gap : 0;
}

}  // namespace exmat
