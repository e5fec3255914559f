#pragma once

#include <Eigen/Core>
#include <cmath>
#include <limits>

namespace exmat::runtime {

/// A potential and the size of the terms that add up to it, by which rounding is judged.
struct PotentialValue {
  double value = 0;
  double magnitude = 0;
};

/// At one point: the potential, and the force scale that the gradient is compared with.
struct PotentialEvaluation {
  PotentialValue potential;
  double force_scale = 0;
};

inline constexpr double kArmijo = 1e-4;         // share of the decrease that the slope promises
inline constexpr int kHalvings = 30;            // at most, of one direction
inline constexpr double kNearRounding = 1e-10;  // of a potential's magnitude: its terms may cancel
inline constexpr double kRounding = 4 * std::numeric_limits<double>::epsilon();  // of a potential's magnitude

/// Start and direction of a search. All but the slope are referred to.
template <class Direction>
struct SearchLine {
  const Eigen::VectorXd& x;
  const Eigen::VectorXd& gradient;
  const Direction& direction;
  const PotentialValue& start;
  double slope = 0;  ///< gradient^T direction, below 0

  /// True if the potential cannot tell the end of the full step from its beginning.
  bool below_rounding() const { return std::abs(slope) <= kRounding * start.magnitude; }
  /// True if the end of the full step is lower as far as its slope there tells, the values being equal but for terms
  /// that cancel (the approximate condition of Hager and Zhang 2005).
  bool is_lower_by_slope(const PotentialValue& value, double slope_there) const {
    return value.value <= start.value + kNearRounding * start.magnitude && std::abs(slope_there) <= 0.9 * -slope &&
           -slope <= kNearRounding * start.magnitude;
  }
  /// Armijo's rule for a share of the full step, but for rounding.
  bool is_low_enough(double length, const PotentialValue& value) const {
    return value.value <= start.value + kArmijo * length * slope + kRounding * start.magnitude;
  }
};

/// End of a search; of the size of x, and referred to.
struct SearchEnd {
  Eigen::VectorXd& x;
  Eigen::VectorXd& gradient;
  PotentialEvaluation& there;
};

template <class Problem>
inline constexpr bool kSeeksLowest = requires {
  requires Problem::kSeeksLowest;
};

/// Armijo backtracking: the full step, or else the first half, quarter, ... of it that is low enough. What it asks of
/// a problem: see newton_minimise(). On success the last evaluate() was at the end; false where no length is low
/// enough, `end` then holds anything. Adds to `evaluations` the calls of value().
template <class Problem, class Direction>
bool search_line(Problem& problem, const SearchLine<Direction>& line, const SearchEnd& end, int& evaluations) {
  end.x = line.x + line.direction;
  end.there = problem.evaluate(end.x, end.gradient);
  if (line.is_low_enough(1, end.there.potential)) return true;
  if (line.is_lower_by_slope(end.there.potential, end.gradient.dot(line.direction))) return true;
  // Forces without a potential may need what raises it.
  if constexpr (requires { problem.gyroscopic(); })
    if (end.gradient.norm() <= 0.5 * line.gradient.norm()) return true;
  double length = 1, lowest = 0;
  bool found = false;
  for (int halving = 0; halving < kHalvings && (!found || kSeeksLowest<Problem>); ++halving) {
    end.x = line.x + 0.5 * length * line.direction;
    ++evaluations;
    const PotentialValue value = problem.value(end.x);
    if (found && !(value.value < lowest)) break;
    length *= 0.5;
    lowest = value.value;
    found = found || line.is_low_enough(length, value);
  }
  if (!found) return false;
  end.x = line.x + length * line.direction;
  end.there = problem.evaluate(end.x, end.gradient);
  return true;
}

}  // namespace exmat::runtime
