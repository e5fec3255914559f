#pragma once

#include <Eigen/Core>
#include <cinttypes>

#include "runtime/api/arguments.h"

namespace exmat::runtime {

/// A frame of the C API: 3 x 4 numbers by rows, axes to the world and its origin [m].
using FrameMatrix = Eigen::Matrix<double, 3, 4, Eigen::RowMajor>;
inline constexpr std::int64_t kFrameNumbers = FrameMatrix::SizeAtCompileTime;

inline Eigen::Map<const FrameMatrix> frame_at(const double* numbers) { return Eigen::Map<const FrameMatrix>(numbers); }

/// EXMAT_OK where all numbers of so many frames are finite and near.
inline exmat_status check_frames(const char* function, const char* argument, const double* numbers,
                                 std::int64_t frames) noexcept {
  const double* const far = find_far(numbers, kFrameNumbers * frames);
  if (far == nullptr) return EXMAT_OK;
  return fail(EXMAT_INVALID_ARGUMENT, "%s: %s[%td] = %g: expected finite numbers of at most %g", function, argument,
              far - numbers, *far, kFarthest);
}

}  // namespace exmat::runtime
