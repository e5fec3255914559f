#pragma once

#include <Eigen/SparseCore>
#include <cstdint>
#include <vector>

#include "common/core/arrays.h"

namespace exmat::precompute {

/// A prefactored sparse matrix, in single precision, that is solved for the three columns of a field of positions at
/// once: a third of the passes over the factor that a solver for single columns takes. For preconditioning.
class CholeskyFactor {
 public:
  /// [n x n] symmetric, positive definite. `what` is for the message: throws WorkError where the matrix is not.
  CholeskyFactor(const Eigen::SparseMatrix<double>& matrix, const char* what);

  /// [n x 3] the solution for a right side [n x 3], to about 1e-6 of it.
  VertexArray solve(const VertexArray& right) const;

 private:
  // P A P^T = L L^T: L by columns, the diagonal apart.
  std::vector<std::int32_t> order_;  // row of P b -> row of b
  std::vector<std::int64_t> begins_;
  std::vector<std::int32_t> rows_;
  std::vector<float> values_, inverse_diagonal_;
};

}  // namespace exmat::precompute
