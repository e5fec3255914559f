#pragma once

#include <Eigen/Core>
#include <vector>

#include "runtime/kernels/aligned_array.h"

namespace exmat::test {

using runtime::AlignedArray;
using runtime::kLanes;

/// A body in each row.
using LaneRows = Eigen::Matrix<double, kLanes, Eigen::Dynamic>;

inline AlignedArray in_lanes(const LaneRows& rows) {
  AlignedArray numbers(rows.size());
  Eigen::Map<LaneRows>(numbers.data(), kLanes, rows.cols()) = rows;
  return numbers;
}

inline LaneRows out_of_lanes(const AlignedArray& numbers, Eigen::Index size) {
  return Eigen::Map<const LaneRows>(numbers.data(), kLanes, size);
}

/// The lower triangles of symmetric matrices, one in each lane; what nobody may read is `unread`.
inline AlignedArray in_lanes(const std::vector<Eigen::MatrixXd>& matrices, double unread = 1e300) {
  const Eigen::Index n = matrices.front().rows();
  AlignedArray numbers(runtime::lane_triangle(n));
  for (std::ptrdiff_t i = 0; i < numbers.size(); ++i) numbers[i] = unread;
  for (Eigen::Index i = 0; i < n; ++i)
    for (Eigen::Index j = 0; j <= i; ++j)
      for (std::size_t lane = 0; lane < matrices.size(); ++lane)
        numbers[runtime::lane_entry(i, j) + static_cast<std::ptrdiff_t>(lane)] = matrices[lane](i, j);
  return numbers;
}

}  // namespace exmat::test
