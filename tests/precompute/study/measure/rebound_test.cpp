#include "precompute/study/measure/rebound.h"

#include <gtest/gtest.h>
#include <limits>
#include <string>

namespace exmat::precompute {
namespace {

// The start and steps of a second each, 'x' with contact, each of which adds 1 m/s along z; so does '+' without one.
std::optional<Rebound> find(const std::string& steps, double pause) {
  ReboundFinder finder(pause);
  Eigen::Vector3d velocity(0, 0, -3);
  finder.add(0, false, velocity);
  for (std::size_t i = 0; i < steps.size(); ++i) {
    if (steps[i] != '.') velocity.z() += 1;
    finder.add(static_cast<double>(i + 1), steps[i] == 'x', velocity);
  }
  return finder.found();
}

TEST(Rebound, IsTheFirstStepAfterContact) {
  const auto found = find("..xxxx......", 3);
  ASSERT_TRUE(found);
  EXPECT_EQ(found->time, 7);
  EXPECT_EQ(found->velocity.z(), 1);
  EXPECT_EQ(find("xx......", 3).value().velocity.z(), -1) << "from the first step on";
  EXPECT_EQ(find("..xxxx++++++", 3).value().velocity.z(), 2) << "not what acts later";
}

TEST(Rebound, WaitsUntilContactDoesNotComeBack) {
  EXPECT_EQ(find("..xx..x....", 3).value().time, 8) << "the same landing";
  EXPECT_EQ(find("..xx...x....", 3).value().time, 9) << "the last step of the pause";
}

TEST(Rebound, IsThatOfTheStrongestContact) {
  EXPECT_EQ(find("..xx....x....", 3).value().time, 5) << "and a touch";
  EXPECT_EQ(find("..x....xx....", 3).value().time, 10) << "a touch, and";
  EXPECT_EQ(find("..xx....xx....", 3).value().time, 5) << "the first of equal ones";
}

TEST(Rebound, IsNoneWithoutContactOrWithoutItsEnd) {
  EXPECT_FALSE(find("........", 3));
  EXPECT_FALSE(find("..xxxxxx", 3));
  EXPECT_FALSE(find("..xxxx..", 3)) << "it may come back";
  EXPECT_TRUE(find("..xxxx....", 3));
  EXPECT_FALSE(find("..xx.....xxx", 3)) << "the strongest lasts";
  EXPECT_EQ(find("..xx.....x", 3).value().time, 5) << "what lasts is a touch";
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
