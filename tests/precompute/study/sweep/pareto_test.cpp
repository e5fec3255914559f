#include "precompute/study/sweep/pareto.h"

#include <algorithm>
#include <gtest/gtest.h>
#include <limits>
#include <random>

namespace exmat::precompute {
namespace {

// By the definition.
bool is_beaten(const std::vector<Outcome>& outcomes, std::size_t i) {
  const Outcome& mine = outcomes[i];
  return std::ranges::any_of(outcomes, [&](const Outcome& other) {
    return other.error <= mine.error && other.seconds <= mine.seconds &&
           (other.error < mine.error || other.seconds < mine.seconds);
  });
}

// Coordinates of few values, so that ties and equal outcomes occur.
std::vector<Outcome> random_outcomes(std::mt19937& random, std::size_t count) {
  std::uniform_int_distribution<int> value(1, 8);
  std::vector<Outcome> outcomes(count);
  for (Outcome& outcome : outcomes) outcome = {static_cast<double>(value(random)), static_cast<double>(value(random))};
  return outcomes;
}

TEST(ParetoFront, IsWhatNothingBeatsByBruteForce) {
  std::mt19937 random(1);
  for (int round = 0; round < 300; ++round) {
    const auto outcomes = random_outcomes(random, 1 + round % 20);
    const auto front = pareto_front(outcomes);
    for (std::size_t i = 0; i < outcomes.size(); ++i) {
      const bool equal_in_front = std::ranges::any_of(front, [&](std::size_t j) {
        return outcomes[j].error == outcomes[i].error && outcomes[j].seconds == outcomes[i].seconds;
      });
      EXPECT_EQ(equal_in_front, !is_beaten(outcomes, i));
    }
    for (std::size_t i = 1; i < front.size(); ++i) {
      EXPECT_LT(outcomes[front[i - 1]].seconds, outcomes[front[i]].seconds);
      EXPECT_GT(outcomes[front[i - 1]].error, outcomes[front[i]].error);
    }
  }
}

TEST(ParetoFront, LeavesOutWhatIsNotFinite) {
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(pareto_front({{kNone, 1}, {1, 2}, {0, std::numeric_limits<double>::infinity()}}),
            std::vector<std::size_t>{1});
  EXPECT_TRUE(pareto_front({}).empty());
}

TEST(Choose, IsTheBestThatMeetsTheBudgetByBruteForce) {
  std::mt19937 random(2);
  for (int round = 0; round < 300; ++round) {
    const auto outcomes = random_outcomes(random, 1 + round % 12);
    const double limit = 1 + round % 9;
    double least_error = 100, least_seconds = 100;
    for (const Outcome& outcome : outcomes) {
      if (outcome.seconds <= limit) least_error = std::min(least_error, outcome.error);
      if (outcome.error <= limit) least_seconds = std::min(least_seconds, outcome.seconds);
    }
    const auto accurate = choose(outcomes, {.seconds = limit, .error = {}});
    const auto fast = choose(outcomes, {.seconds = {}, .error = limit});
    ASSERT_EQ(accurate.has_value(), least_error < 100);
    ASSERT_EQ(fast.has_value(), least_seconds < 100);
    if (accurate) {
      EXPECT_EQ(outcomes[*accurate].error, least_error);
      EXPECT_LE(outcomes[*accurate].seconds, limit);
    }
    if (fast) {
      EXPECT_EQ(outcomes[*fast].seconds, least_seconds);
      EXPECT_LE(outcomes[*fast].error, limit);
    }
  }
}

TEST(Choose, MeetsBothLimitsAndElseNamesTheNearest) {
  const std::vector<Outcome> outcomes = {{0.01, 100e-6}, {0.02, 50e-6}, {0.1, 10e-6}};
  EXPECT_EQ(choose(outcomes, {.seconds = 60e-6, .error = 0.05}), 1U);
  EXPECT_EQ(choose(outcomes, {.seconds = 60e-6, .error = 0.015}), std::nullopt);
  EXPECT_EQ(nearest(outcomes, {.seconds = 60e-6, .error = 0.015}), 1U) << "1.33 times, the first 1.67 times";
  EXPECT_EQ(nearest(outcomes, {.seconds = 9e-6, .error = {}}), 2U);
  EXPECT_EQ(nearest({}, {.seconds = 1.0, .error = {}}), std::nullopt);
}

}  // namespace
}  // namespace exmat::precompute
