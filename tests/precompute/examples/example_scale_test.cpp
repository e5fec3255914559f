#include "precompute/examples/example_scale.h"

#include <cmath>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace exmat::precompute {
namespace {

using testing::HasSubstr;

constexpr double kVolume = 2.4;

PoseScale of_length(double ratio, bool same_mesh = false) {
  return scale_of_pose(std::pow(ratio, 3) * kVolume, kVolume, same_mesh);
}

TEST(PoseScale, SizesUpToTwiceAreThePosesOwn) {
  for (const bool same_mesh : {false, true})
    for (const double ratio : {0.55, 0.8, 0.97, 1.0, 1.03, 1.3, 1.9}) {
      const PoseScale scale = of_length(ratio, same_mesh);
      EXPECT_EQ(scale.unit, 1) << ratio;
      EXPECT_NEAR(scale.size, ratio, 1e-12);
      EXPECT_TRUE(scale.note.empty());
      EXPECT_TRUE(scale.objection.empty());
      EXPECT_EQ(scale.warning.empty(), std::abs(ratio - 1) < 0.035) << ratio;
    }
  EXPECT_THAT(of_length(1.3).warning, HasSubstr("volume is 2.2 times the rest example's (1.3 times in length)"));
}

// Millimetres, inches, feet and powers of ten, to either side, of a body that is a little smaller than at rest.
TEST(PoseScale, UnitsOfLengthAreDividedOut) {
  for (const double unit : {1000.0, 100.0, 10.0, 25.4, 2.54, 12.0, 1 / 0.3048, 1 / 0.0254})
    for (const double ratio : {unit, 1 / unit}) {
      const PoseScale scale = of_length(0.98 * ratio);
      EXPECT_NEAR(scale.unit, ratio, 1e-12 * ratio);
      EXPECT_NEAR(scale.size, 0.98, 1e-12);
      EXPECT_THAT(scale.note, HasSubstr("another unit of length"));
      EXPECT_TRUE(scale.warning.empty());
      EXPECT_THAT(of_length(0.98 * ratio, true).objection, HasSubstr("keeps the rest example's unit"));
    }
}

TEST(PoseScale, OtherScalesAreBroughtToTheRestsVolumeWithAWarning) {
  for (const double ratio : {0.35, 2.2, 5.0, 37.0, 1e5}) {
    const PoseScale scale = of_length(ratio);
    EXPECT_NEAR(scale.unit, ratio, 1e-12 * ratio);
    EXPECT_NEAR(scale.size, 1, 1e-12);
    EXPECT_THAT(scale.warning, HasSubstr("no units of length explain"));
    EXPECT_EQ(of_length(ratio, true).unit, 1);
    EXPECT_FALSE(of_length(ratio, true).objection.empty());
  }
}

TEST(RemarkOnRestScale, IsOnSizesThatAreNeitherTheObjectsNorAUnit) {
  const auto of = [](double ratio) { return remark_on_rest_scale(std::pow(ratio, 3) * kVolume, kVolume); };
  for (const double ratio : {0.85, 1.0, 1.2, 10.0, 0.001, 25.4}) EXPECT_EQ(of(ratio), "") << ratio;
  for (const double ratio : {0.5, 1.5, 3.0}) EXPECT_NE(of(ratio), "") << ratio;
  EXPECT_THAT(of(3), HasSubstr("3 times as large as the object"));
}

}  // namespace
}  // namespace exmat::precompute
