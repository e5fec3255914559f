#pragma once

#include <Eigen/Core>
#include <cstdint>

namespace exmat {

/// Row-major, as in the bundle's datasets.
using RowMatrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
using RowMatrix3 = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
using VertexArray = Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>;          ///< n x 3
using TetArray = Eigen::Matrix<std::int32_t, Eigen::Dynamic, 4, Eigen::RowMajor>;       ///< n_t x 4, 0-based
using TriangleArray = Eigen::Matrix<std::int32_t, Eigen::Dynamic, 3, Eigen::RowMajor>;  ///< n_f x 3, 0-based
using IndexMatrix = Eigen::Matrix<std::int32_t, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
using IndexVector = Eigen::Matrix<std::int32_t, Eigen::Dynamic, 1>;
using FlagVector = Eigen::Matrix<std::uint8_t, Eigen::Dynamic, 1>;

}  // namespace exmat
