#include "precompute/study/measure/rebound.h"

#include <gtest/gtest.h>
#include <limits>
#include <string>

namespace exmat::precompute {
namespace {

// Steps of a second each, 'x' with contact; the velocity of the centre is the number of the step.
std::optional<Rebound> find(const std::string& steps, double pause) {
  ReboundFinder finder(pause);
  for (std::size_t i = 0; i < steps.size(); ++i) {
    const auto time = static_cast<double>(i + 1);
    finder.add(time, steps[i] == 'x', {0, 0, time});
  }
  return finder.found();
}

TEST(Rebound, IsTheFirstStepAfterContact) {
  const auto found = find("..xx......", 3);
  ASSERT_TRUE(found);
  EXPECT_EQ(found->time, 5);
  EXPECT_EQ(found->velocity.z(), 5);
}

TEST(Rebound, WaitsUntilContactDoesNotComeBack) {
  EXPECT_EQ(find("..xx..x....", 3).value().time, 8) << "the same landing";
  EXPECT_EQ(find("..xx....x....", 3).value().time, 5) << "another landing";
}

TEST(Rebound, IsNoneWithoutContactOrWithoutItsEnd) {
  EXPECT_FALSE(find("........", 3));
  EXPECT_FALSE(find("..xxxxxx", 3));
  EXPECT_FALSE(find("..xxxx..", 3)) << "it may come back";
  EXPECT_TRUE(find("..xxxx....", 3));
}

TEST(Rebound, IsComparedWhereBothBounced) {
  const Rebound up{1, {0, 0, 4}}, faster{1.2, {3, 0, 4}}, none{1, {0, 0, 0}};
  EXPECT_EQ(rebound_error(faster, up), 0.75);
  EXPECT_EQ(rebound_error(up, faster), 0.6);
  EXPECT_EQ(rebound_error(up, up), 0);
  EXPECT_FALSE(rebound_error(std::nullopt, up));
  EXPECT_FALSE(rebound_error(up, std::nullopt));
  EXPECT_EQ(rebound_error(none, none), 0);
  EXPECT_EQ(rebound_error(up, none), std::numeric_limits<double>::infinity());
}

}  // namespace
}  // namespace exmat::precompute
