#include "runtime/sim/world/broad_phase.h"

#include <algorithm>

namespace exmat::runtime {

void overlapping_pairs(const std::vector<DeformationTree::Ball>& balls, const std::vector<int>& chosen,
                       std::vector<int>& order, std::vector<std::pair<int, int>>& pairs) {
  pairs.clear();
  if (chosen.empty()) return;
  const auto ball = [&](int index) -> const DeformationTree::Ball& { return balls[static_cast<std::size_t>(index)]; };
  Eigen::Vector3d low = ball(chosen.front()).centre, high = low;
  for (const int index : chosen) {
    low = low.cwiseMin(ball(index).centre);
    high = high.cwiseMax(ball(index).centre);
  }
  Eigen::Index axis = 0;
  (high - low).maxCoeff(&axis);
  const auto start = [&](int index) { return ball(index).centre[axis] - ball(index).radius; };
  order = chosen;
  std::ranges::sort(order, [&](int a, int b) { return start(a) != start(b) ? start(a) < start(b) : a < b; });
  for (std::size_t i = 0; i < order.size(); ++i) {
    const int a = order[i];
    const double end = ball(a).centre[axis] + ball(a).radius;
    for (std::size_t j = i + 1; j < order.size() && start(order[j]) <= end; ++j) {
      const int b = order[j];
      const double reach = ball(a).radius + ball(b).radius;
      if ((ball(a).centre - ball(b).centre).squaredNorm() > reach * reach) continue;
      pairs.emplace_back(std::min(a, b), std::max(a, b));
    }
  }
  std::ranges::sort(pairs);
}

}  // namespace exmat::runtime
