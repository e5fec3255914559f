#pragma once

#include <vector>

#include "runtime/kernels/kernels.h"

namespace exmat::runtime {

/// Doubles at kAlignment, zero at first, as many as asked for rounded up to a multiple of kLanes.
class AlignedArray {
 public:
  AlignedArray() = default;
  explicit AlignedArray(std::ptrdiff_t size) : groups_(static_cast<std::size_t>(padded(size) / kLanes)) {}

  double* data() { return reinterpret_cast<double*>(groups_.data()); }
  const double* data() const { return reinterpret_cast<const double*>(groups_.data()); }
  std::ptrdiff_t size() const { return kLanes * static_cast<std::ptrdiff_t>(groups_.size()); }
  double& operator[](std::ptrdiff_t i) { return data()[i]; }
  double operator[](std::ptrdiff_t i) const { return data()[i]; }

 private:
  struct alignas(kAlignment) Group {
    double values[kLanes] = {};
  };
  std::vector<Group> groups_;
};

}  // namespace exmat::runtime
