#include <cmath>
#include <numbers>

// Sums, products, quotients and roots are rounded alike by every machine, so these series are, too.

namespace {

constexpr double kLostOfPi = 1.2246467991473532e-16;  // pi less its double

/// The sum of the first `terms` of (-square)^n / ((first + 1) (first + 2) ... (first + 2 n)).
double turns(double square, int first, int terms) {
  double sum = 1;
  for (int n = terms; n >= 1; --n) sum = 1 - square * sum / ((first + 2 * n - 1.0) * (first + 2 * n));
  return sum;
}

struct Turn {
  double rest;  ///< [-pi/4, pi/4]
  int quarter;  ///< 0 to 3
};

/// An angle less quarters of a turn. The first two parts of pi / 2 have 33 bits each, so that the products are exact up
/// to a million quarters. Angles beyond are less exact, and the same everywhere.
Turn without_quarters(double angle) {
  constexpr double kFirst = 0x1.921fb544p+0, kSecond = 0x1.0b4611a6p-34, kThird = 0x1.3198a2e037073p-69;
  if (std::abs(angle) > 1e6) angle = std::remainder(angle, 2 * std::numbers::pi);
  const double count = std::round(angle * (2 / std::numbers::pi));
  const double high = angle - count * kFirst, middle = count * kSecond;
  const double sum = high - middle;
  const double rest = sum + (((high - sum) - middle) - count * kThird);
  return {rest, static_cast<int>(std::remainder(count, 4)) & 3};
}

double sine(double x) { return x - x * (x * x / 6 * turns(x * x, 3, 8)); }
double cosine(double x) {
  // The rest takes what the rounding of 1 - x^2/2 lost.
  const double half = 0.5 * x * x, first = 1 - half;
  return first + (((1 - first) - half) + half * (x * x) / 12 * turns(x * x, 4, 8));
}

/// The sum of the first `terms` of square^n / (2 n + 3), of alternating signs if `square` is negative.
double odd_series(double square, int terms) {
  double sum = 0;
  for (int n = terms; n >= 0; --n) sum = sum * square + 1.0 / (2 * n + 3);
  return sum;
}

/// atan(y / x), 0 <= y <= x, 0 < x.
double first_octant(double y, double x) {
  const bool is_steep = y > 0.4142135623730951 * x;
  const double t = is_steep ? (y - x) / (y + x) : y / x;
  const double less = t * (t * t) * odd_series(-t * t, 20);
  return is_steep ? std::numbers::pi / 4 + (t - (less - kLostOfPi / 4)) : t - less;
}

/// log(x + lost), x > 0 and finite.
double logarithm(double x, double lost) {
  int exponent = 0;
  double part = std::frexp(x, &exponent);
  if (part < std::numbers::sqrt2 / 2) {
    part *= 2;
    --exponent;
  }
  // log(1 + f) = f - (f^2/2 - s (f^2/2 + r)), s = f / (2 + f), r = 2 s^2 (1/3 + s^2/5 + ...) without cancellation.
  const double f = part - 1, s = f / (2 + f), half = 0.5 * f * f;
  const double tail = s * (half + 2 * s * s * odd_series(s * s, 10)) + lost / x;
  constexpr double kLn2High = 0x1.62e42feep-1, kLn2Low = 0x1.a39ef35793c76p-33;
  return exponent * kLn2High - ((half - (tail + exponent * kLn2Low)) - f);
}

}  // namespace

extern "C" {

double exmat_portable_sin(double x) {
  if (std::abs(x) < 1e-8 || !std::isfinite(x)) return std::isinf(x) ? x - x : x;
  const auto [rest, quarter] = without_quarters(x);
  const double size = quarter % 2 == 0 ? sine(rest) : cosine(rest);
  return quarter < 2 ? size : -size;
}

double exmat_portable_cos(double x) {
  if (!std::isfinite(x)) return x - x;
  const auto [rest, quarter] = without_quarters(x);
  const double size = quarter % 2 == 0 ? cosine(rest) : sine(rest);
  return quarter == 1 || quarter == 2 ? -size : size;
}

double exmat_portable_atan2(double y, double x) {
  const double up = std::abs(y), along = std::abs(x);
  if (!(up + along > 0) || std::isinf(up) || std::isinf(along)) {
    if (std::isnan(x) || std::isnan(y)) return x + y;
    return exmat_portable_atan2(std::copysign(std::isinf(y) || !std::isinf(x) ? std::isinf(y) : 0.0, y),
                                std::copysign(std::isinf(x) || !std::isinf(y) ? 1.0 : 0.0, x));
  }
  if (up > along)
    return std::copysign(std::numbers::pi / 2 - (std::copysign(first_octant(along, up), x) - kLostOfPi / 2), y);
  const double angle = first_octant(up, along);
  return std::copysign(std::signbit(x) ? std::numbers::pi - (angle - kLostOfPi) : angle, y);
}

double exmat_portable_acos(double x) { return exmat_portable_atan2(std::sqrt((1 - x) * (1 + x)), x); }

double exmat_portable_log(double x) {
  if (!(x > 0) || std::isinf(x)) return x == 0 ? -HUGE_VAL : x < 0 ? (x - x) / (x - x) : x;
  return logarithm(x, 0);
}

double exmat_portable_log1p(double x) {
  const double sum = 1 + x;
  if (std::abs(x) < 1e-8) return x - 0.5 * x * x;
  return sum > 0 && !std::isinf(sum) ? logarithm(sum, sum > 2 ? 1 - (sum - x) : x - (sum - 1))
                                     : exmat_portable_log(sum);
}
}
