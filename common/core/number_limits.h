#pragma once

#include <cmath>
#include <limits>

namespace exmat {

/// Largest number in places [m], velocities [m/s], forces [N] and all else that a user gives: squares are finite, and
/// places fit into single precision.
inline constexpr double kFarthest = 1e30;

/// False for NaN, too.
inline bool is_near(double number) noexcept { return std::abs(number) <= kFarthest; }

/// Doubles that are `far` from the origin are so far apart [m]; 0 if a body of this length loses no detail by it that
/// solvers ask for.
inline double lost_detail(double far, double length) noexcept {
  constexpr double kLostShare = 1e-9;  // of the length, by rounding
  const double gap = far * std::numeric_limits<double>::epsilon();
  return gap > kLostShare * length ? gap : 0;
}

}  // namespace exmat
