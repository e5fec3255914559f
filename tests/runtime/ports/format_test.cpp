// The texts of the part of {fmt} that builds without libraries have are those of {fmt}.
#include <cmath>
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <limits>
#include <random>

#define fmt ports_fmt
#include "runtime/ports/fmt/format.h"
#undef fmt

namespace {

TEST(PortsFormat, NumbersAreThoseOfFmt) {
  using Limits = std::numeric_limits<double>;
  for (const double value : {0.0,
                             -0.0,
                             1.0,
                             100.0,
                             0.1,
                             -2.5,
                             1e-4,
                             1e-5,
                             999999.0,
                             1e6,
                             1e15,
                             1e16,
                             1e17,
                             123456789012345678.0,
                             9.81,
                             1.0 / 3,
                             Limits::max(),
                             Limits::min(),
                             Limits::denorm_min(),
                             Limits::infinity(),
                             -Limits::infinity()})
    EXPECT_EQ(ports_fmt::format("{}", value), fmt::format("{}", value));
  std::mt19937_64 random(1);
  for (int i = 0; i < 10000; ++i) {
    const double value =
        std::ldexp(static_cast<double>(static_cast<std::int64_t>(random())), static_cast<int>(random() % 200) - 130);
    EXPECT_EQ(ports_fmt::format("{}", value), fmt::format("{}", value));
    const auto single = static_cast<float>(value);
    EXPECT_EQ(ports_fmt::format("{}", single), fmt::format("{}", single));
    EXPECT_EQ(ports_fmt::format("{:.3g} {:6.2e}", value, value), fmt::format("{:.3g} {:6.2e}", value, value));
  }
  EXPECT_EQ(ports_fmt::format("{} of {:x}", -7, 255), fmt::format("{} of {:x}", -7, 255));
}

}  // namespace
