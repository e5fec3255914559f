#include "runtime/sim/world/broad_phase.h"

#include <algorithm>
#include <gtest/gtest.h>
#include <numeric>
#include <random>

namespace exmat::runtime {
namespace {

TEST(BroadPhase, FindsThePairsThatBruteForceFinds) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> unit(0, 1);
  for (const double spread : {1.0, 5.0, 20.0}) {
    std::vector<DeformationTree::Ball> balls;
    for (int i = 0; i < 300; ++i)
      balls.push_back(
          {spread * Eigen::Vector3d(unit(random), 0.3 * unit(random), 2 * unit(random)), 0.4 * unit(random)});
    std::vector<std::pair<int, int>> expected, found;
    for (int i = 0; i < 300; ++i)
      for (int j = i + 1; j < 300; ++j) {
        const auto &a = balls[static_cast<std::size_t>(i)], &b = balls[static_cast<std::size_t>(j)];
        if ((a.centre - b.centre).norm() <= a.radius + b.radius) expected.emplace_back(i, j);
      }
    std::vector<int> order, all(balls.size()), even;
    std::iota(all.begin(), all.end(), 0);
    overlapping_pairs(balls, all, order, found);
    EXPECT_EQ(found, expected);
    std::ranges::copy_if(all, std::back_inserter(even), [](int i) { return i % 2 == 0; });
    std::vector<std::pair<int, int>> found_even;
    overlapping_pairs(balls, even, order, found_even);
    std::erase_if(expected, [](const auto& pair) { return pair.first % 2 != 0 || pair.second % 2 != 0; });
    EXPECT_EQ(found_even, expected);
    EXPECT_FALSE(found.empty());
  }
}

TEST(BroadPhase, OfNothingIsNothing) {
  std::vector<int> order;
  std::vector<std::pair<int, int>> pairs{{1, 2}};
  overlapping_pairs({}, {}, order, pairs);
  EXPECT_TRUE(pairs.empty());
}

}  // namespace
}  // namespace exmat::runtime
