#pragma once

#include <cmath>

namespace exmat {

/// Largest number in places [m], velocities [m/s], forces [N] and all else that a user gives: squares are finite, and
/// places fit into single precision.
inline constexpr double kFarthest = 1e30;

/// False for NaN, too.
inline bool is_near(double number) noexcept { return std::abs(number) <= kFarthest; }

}  // namespace exmat
