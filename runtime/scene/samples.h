#pragma once

#include <cstdint>
#include <vector>

namespace exmat::runtime {

/// Mean of all values added, and quantiles of evenly spread ones: every value up to a million expected, every k-th
/// beyond.
class Samples {
 public:
  explicit Samples(std::int64_t expected = 0);

  void add(double value);
  double mean() const;
  /// `share` in [0, 1]: 0.5 is the median. 0 where nothing was added.
  double quantile(double share) const;

 private:
  std::int64_t stride_;
  std::int64_t count_ = 0;
  double sum_ = 0;
  std::vector<double> kept_;
};

}  // namespace exmat::runtime
