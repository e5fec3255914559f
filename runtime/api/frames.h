#pragma once

#include <Eigen/Core>
#include <Eigen/LU>
#include <cinttypes>

#include "runtime/api/arguments.h"

namespace exmat::runtime {

/// A frame of the C API: 3 x 4 numbers by rows, axes to the world and its origin [m].
using FrameMatrix = Eigen::Matrix<double, 3, 4, Eigen::RowMajor>;
inline constexpr std::int64_t kFrameNumbers = FrameMatrix::SizeAtCompileTime;

inline Eigen::Map<const FrameMatrix> frame_at(const double* numbers) { return Eigen::Map<const FrameMatrix>(numbers); }

inline constexpr double kFlatFrame = 1e-9;  // determinant over the cube of the norm

/// EXMAT_OK where all numbers of so many frames are finite and near, and each has a rotation that is nearest to it.
inline exmat_status check_frames(const char* function, const char* argument, const double* numbers,
                                 std::int64_t frames) noexcept {
  const double* const far = find_far(numbers, kFrameNumbers * frames);
  if (far != nullptr)
    return fail(EXMAT_INVALID_ARGUMENT, "%s: %s[%td] = %g: expected finite numbers of at most %g", function, argument,
                far - numbers, *far, kFarthest);
  for (std::int64_t k = 0; k < frames; ++k) {
    const Eigen::Matrix3d turn = frame_at(numbers + kFrameNumbers * k).leftCols<3>();
    const double size = turn.norm(), determinant = turn.determinant();
    if (!(size > 0 && determinant > kFlatFrame * size * size * size))
      return fail(EXMAT_INVALID_ARGUMENT,
                  "%s: %s, frame %" PRId64
                  ": its first three columns have the determinant %g: expected a rotation, "
                  "scaled perhaps, but neither mirrored nor flat",
                  function, argument, k, determinant);
  }
  return EXMAT_OK;
}

}  // namespace exmat::runtime
