#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <random>

namespace exmat::test {

/// Uniform in [-1, 1], the same on every platform.
inline Eigen::VectorXd random_vector(Eigen::Index size, std::uint32_t seed) {
  std::mt19937 generator(seed);
  Eigen::VectorXd vector(size);
  for (double& value : vector) value = 2 * (static_cast<double>(generator()) / 4294967295.0) - 1;
  return vector;
}

/// Uniform in [-1, 1], the same on every platform.
inline Eigen::MatrixXd random_matrix(Eigen::Index rows, Eigen::Index columns, std::uint32_t seed) {
  return random_vector(rows * columns, seed).reshaped(rows, columns);
}

}  // namespace exmat::test
