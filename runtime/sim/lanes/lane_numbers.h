#pragma once

#include <Eigen/Core>

#include "runtime/kernels/aligned_array.h"

namespace exmat::runtime {

/// A number of each of kLanes bodies, and a vector [r] of each (kernels.h).
using LaneNumbers = Eigen::Array<double, kLanes, 1>;
using LaneVectors = Eigen::Map<Eigen::Array<double, kLanes, Eigen::Dynamic>>;

inline LaneNumbers dot(Eigen::Index size, const double* a, const double* b) noexcept {
  LaneNumbers sum;
  kernels().lanes_dot(size, a, b, sum.data());
  return sum;
}

}  // namespace exmat::runtime
