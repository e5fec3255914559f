#pragma once

#include <cstddef>
#include <optional>
#include <vector>

namespace exmat::precompute {

/// Time and error that a choice weighs: both >= 0, smaller is better. One that is not finite is never chosen.
struct Outcome {
  double error = 0;    ///< relative
  double seconds = 0;  ///< time of a step
};

/// Limits of a choice; absent: none.
struct Budget {
  std::optional<double> seconds;
  std::optional<double> error;
};

/// Indices of the outcomes that no other one beats: none is at least as good in both and better in one. Ascending in
/// time, of equal ones the first.
std::vector<std::size_t> pareto_front(const std::vector<Outcome>& outcomes);

/// Chooses among the outcomes that meet the budget the most accurate if it limits the time, else the fastest; nothing
/// if none does.
std::optional<std::size_t> choose(const std::vector<Outcome>& outcomes, const Budget& budget);

/// The outcome that exceeds the limits of the budget by the smallest factor; nothing if none is finite.
std::optional<std::size_t> nearest(const std::vector<Outcome>& outcomes, const Budget& budget);

}  // namespace exmat::precompute
