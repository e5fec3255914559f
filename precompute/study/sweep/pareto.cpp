#include "precompute/study/sweep/pareto.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <tuple>

namespace exmat::precompute {
namespace {

bool is_finite(const Outcome& outcome) { return std::isfinite(outcome.error) && std::isfinite(outcome.seconds); }

// The largest factor by which a limit is exceeded; at most 1 where the budget is met.
double excess(const Outcome& outcome, const Budget& budget) {
  const auto over = [](double value, std::optional<double> limit) {
    if (!limit || value <= *limit) return 1.0;
    return *limit > 0 ? value / *limit : std::numeric_limits<double>::max();
  };
  return std::max(over(outcome.seconds, budget.seconds), over(outcome.error, budget.error));
}

// The smallest by `value` of those that `admits` takes.
template <typename Value, typename Admits>
std::optional<std::size_t> smallest(const std::vector<Outcome>& outcomes, Value value, Admits admits) {
  std::optional<std::size_t> best;
  for (std::size_t i = 0; i < outcomes.size(); ++i)
    if (is_finite(outcomes[i]) && admits(outcomes[i]) && (!best || value(outcomes[i]) < value(outcomes[*best])))
      best = i;
  return best;
}

}  // namespace

std::vector<std::size_t> pareto_front(const std::vector<Outcome>& outcomes) {
  std::vector<std::size_t> order;
  for (std::size_t i = 0; i < outcomes.size(); ++i)
    if (is_finite(outcomes[i])) order.push_back(i);
  std::ranges::stable_sort(order, {},
                           [&](std::size_t i) { return std::tuple(outcomes[i].seconds, outcomes[i].error); });
  std::vector<std::size_t> front;
  for (const std::size_t i : order)
    if (front.empty() || outcomes[i].error < outcomes[front.back()].error) front.push_back(i);
  return front;
}

std::optional<std::size_t> choose(const std::vector<Outcome>& outcomes, const Budget& budget) {
  const auto meets = [&](const Outcome& outcome) { return excess(outcome, budget) <= 1; };
  if (budget.seconds)
    return smallest(
        outcomes, [](const Outcome& o) { return std::tuple(o.error, o.seconds); }, meets);
  return smallest(
      outcomes, [](const Outcome& o) { return std::tuple(o.seconds, o.error); }, meets);
}

std::optional<std::size_t> nearest(const std::vector<Outcome>& outcomes, const Budget& budget) {
  return smallest(
      outcomes, [&](const Outcome& o) { return excess(o, budget); }, [](const Outcome&) { return true; });
}

}  // namespace exmat::precompute
