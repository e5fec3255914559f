#pragma once

#include <Eigen/Core>
#include <Eigen/SparseCore>
#include <cstdint>
#include <vector>

#include "precompute/solvers/elimination.h"

namespace exmat::precompute {

/// L L^T of sparse symmetric matrices of one pattern, by a multifrontal method: columns of L of one structure are dense
/// blocks together, so that nearly all operations are products of dense matrices. Ordering and symbolic part once
/// (approximate minimum degree). Liu 1992.
class SupernodalCholesky {
 public:
  using Matrix = Eigen::SparseMatrix<double>;

  /// The lower triangle of the pattern, by columns.
  explicit SupernodalCholesky(const Matrix& pattern);

  /// Factorises from the lower triangle of a matrix of that pattern. False where it is not positive definite; then
  /// there are no factors.
  bool factorise(const Matrix& matrix);

  /// x = A^-1 b.
  Eigen::VectorXd solve(const Eigen::VectorXd& b) const;

  std::int64_t entries() const { return plan_.entries(); }  ///< entries of L, zeros of its blocks among them
  double operations() const { return plan_.operations(); }  ///< operations of a factorisation

 private:
  /// Target of a value of the matrix.
  struct Entry {
    std::int32_t row = 0, column = 0;
  };

  void place_entries(const Matrix& pattern);
  bool eliminate(std::size_t index, const Matrix& matrix, std::vector<Eigen::MatrixXd>& updates);

  Elimination plan_;
  std::vector<Eigen::MatrixXd> blocks_;            ///< [(columns + rows) x columns] of each node
  std::vector<std::vector<std::int32_t>> values_;  ///< matrix values that each node takes in, indices into entry_
  std::vector<Entry> entry_;                       ///< target of each value
  std::vector<std::int32_t> position_;             ///< scratch: of each row in a front
};

}  // namespace exmat::precompute
