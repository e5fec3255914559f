// The functions of portable builds, beside those of the C library for long double.
#include <gtest/gtest.h>
#include <limits>
#include <random>

#include "runtime/ports/portable/functions.cpp"

namespace {

/// Largest distance from the truth in the last place of the double, over numbers that are drawn from a range.
template <class Function, class Truth>
double most_units(double low, double high, Function function, Truth truth) {
  std::mt19937_64 random(1);
  double most = 0;
  for (int i = 0; i < 20000; ++i) {
    const double x = low + (high - low) * static_cast<double>(random() >> 11U) * 0x1p-53;
    const long double expected = truth(static_cast<long double>(x));
    const double size = std::abs(static_cast<double>(expected));
    const double unit = std::nextafter(size, std::numeric_limits<double>::infinity()) - size;
    most = std::max(most, std::abs(static_cast<double>(static_cast<long double>(function(x)) - expected)) / unit);
  }
  return most;
}

TEST(PortableFunctions, DifferByTheLastPlacesAtMost) {
  for (const double end : {0.01, 0.8, 4.0, 100.0, 1e6}) {
    EXPECT_LT(most_units(-end, end, exmat_portable_sin, [](long double x) { return std::sin(x); }), 2) << end;
    EXPECT_LT(most_units(-end, end, exmat_portable_cos, [](long double x) { return std::cos(x); }), 2) << end;
  }
  for (const double end : {0.01, 0.5, 3.0, 1e5})
    for (const double x : {1.0, -1.0}) {
      const auto angle = [x](double y) { return exmat_portable_atan2(y, x); };
      EXPECT_LT(most_units(-end, end, angle, [x](long double y) { return std::atan2(y, x); }), 2) << end;
    }
  EXPECT_LT(most_units(-1, 1, exmat_portable_acos, [](long double x) { return std::acos(x); }), 3);
  for (const double end : {0.7, 1.5, 10.0, 1e300})
    EXPECT_LT(most_units(0, end, exmat_portable_log, [](long double x) { return std::log(x); }), 1) << end;
  for (const double end : {-0.7, -0.1, 0.1, 1.5, 1e300})
    EXPECT_LT(most_units(0, end, exmat_portable_log1p, [](long double x) { return std::log1p(x); }), 1) << end;
}

bool same(double a, double b) {
  return (std::isnan(a) && std::isnan(b)) || (a == b && std::signbit(a) == std::signbit(b));
}

TEST(PortableFunctions, AreThoseOfTheCLibraryAtTheEndsOfTheirRanges) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity(), kNan = std::numeric_limits<double>::quiet_NaN();
  const double ends[] = {0.0, -0.0, 1.0, -1.0, kInfinity, -kInfinity, kNan, 1e-320, -1e-320};
  for (const double x : ends) {
    EXPECT_TRUE(same(exmat_portable_sin(x), std::sin(x))) << x;
    EXPECT_TRUE(same(exmat_portable_cos(x), std::cos(x))) << x;
    EXPECT_TRUE(same(exmat_portable_acos(x), std::acos(x))) << x;
    EXPECT_TRUE(same(exmat_portable_log(x), std::log(x))) << x;
    EXPECT_TRUE(same(exmat_portable_log1p(x), std::log1p(x))) << x;
    for (const double y : ends) EXPECT_TRUE(same(exmat_portable_atan2(y, x), std::atan2(y, x))) << y << ' ' << x;
  }
  for (const double x : {1e7, -1e300, 1e308}) {
    const double sine = exmat_portable_sin(x), cosine = exmat_portable_cos(x);
    EXPECT_NEAR(sine * sine + cosine * cosine, 1, 1e-15) << x;
  }
}

}  // namespace
