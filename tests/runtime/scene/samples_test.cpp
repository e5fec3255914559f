#include "runtime/scene/samples.h"

#include <gtest/gtest.h>

namespace exmat::runtime {
namespace {

TEST(SamplesTest, MeanAndQuantiles) {
  Samples samples(101);
  for (int i = 100; i >= 0; --i) samples.add(i);
  EXPECT_EQ(samples.mean(), 50);
  EXPECT_EQ(samples.quantile(0.5), 50);
  EXPECT_EQ(samples.quantile(0.95), 95);
  EXPECT_EQ(samples.quantile(0), 0);
  EXPECT_EQ(samples.quantile(1), 100);
}

TEST(SamplesTest, NothingAddedIsZero) {
  EXPECT_EQ(Samples().mean(), 0);
  EXPECT_EQ(Samples().quantile(0.5), 0);
}

TEST(SamplesTest, LongRunsKeepEvenlySpreadValues) {
  Samples samples(3'000'000);
  for (int i = 0; i < 3'000'000; ++i) samples.add(i);
  EXPECT_EQ(samples.mean(), 1499999.5);
  EXPECT_NEAR(samples.quantile(0.5), 1.5e6, 10);
}

}  // namespace
}  // namespace exmat::runtime
