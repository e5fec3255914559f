#include "runtime/scene/samples.h"

#include <algorithm>
#include <cmath>

namespace exmat::runtime {
namespace {

constexpr std::int64_t kMostKept = 1'000'000;

}  // namespace

Samples::Samples(std::int64_t expected) : stride_(expected / kMostKept + 1) {}

void Samples::add(double value) {
  if (count_ % stride_ == 0) kept_.push_back(value);
  ++count_;
  sum_ += value;
}

double Samples::mean() const { return count_ > 0 ? sum_ / static_cast<double>(count_) : 0; }

double Samples::quantile(double share) const {
  if (kept_.empty()) return 0;
  std::vector<double> sorted = kept_;
  const auto rank = std::llround(share * static_cast<double>(sorted.size() - 1));
  std::nth_element(sorted.begin(), sorted.begin() + rank, sorted.end());
  return sorted[static_cast<std::size_t>(rank)];
}

}  // namespace exmat::runtime
