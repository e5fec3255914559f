#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <numeric>
#include <vector>

namespace exmat {

/// Numbers 0 to n-1 in sets that are joined; of each set the smallest number stands for it. Tarjan 1975, with path
/// halving.
class DisjointSets {
 public:
  explicit DisjointSets(std::size_t count = 0) { reset(count); }

  /// Each number is a set of its own.
  void reset(std::size_t count) {
    parents_.resize(count);
    std::iota(parents_.begin(), parents_.end(), 0);
  }

  std::int32_t root(std::int32_t number) {
    while (parent(number) != number) number = parent(number) = parent(parent(number));
    return number;
  }

  void join(std::int32_t a, std::int32_t b) {
    const auto [first, second] = std::minmax({root(a), root(b)});
    parent(second) = first;
  }

 private:
  std::int32_t& parent(std::int32_t number) { return parents_[static_cast<std::size_t>(number)]; }

  std::vector<std::int32_t> parents_;
};

}  // namespace exmat
