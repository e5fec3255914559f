#pragma once

#include <Eigen/Core>
#include <Eigen/SparseCore>
#include <cstdint>
#include <vector>

namespace exmat::precompute {

/// L L^T of sparse symmetric matrices of one pattern, by a multifrontal method: columns of L of one structure are dense
/// blocks together, so that nearly all operations are products of dense matrices. Ordering and symbolic part once
/// (approximate minimum degree). Liu 1992.
class SupernodalCholesky {
 public:
  using Matrix = Eigen::SparseMatrix<double>;

  /// The lower triangle of the pattern, by columns.
  explicit SupernodalCholesky(const Matrix& pattern);

  /// Of the lower triangle of a matrix of that pattern. False where it is not positive definite; then there are no
  /// factors.
  bool factorise(const Matrix& matrix);

  /// x = A^-1 b.
  Eigen::VectorXd solve(const Eigen::VectorXd& b) const;

  std::int64_t entries() const { return entries_; }  ///< of L, zeros of its blocks among them
  double operations() const { return operations_; }  ///< of a factorisation, a sum of squares by columns of L

 private:
  struct Node {
    std::int32_t begin = 0, columns = 0;  ///< of L
    std::vector<std::int32_t> rows;       ///< below them, ascending
    std::vector<std::int32_t> children{};
    std::vector<std::int32_t> values{};  ///< of the matrix that its columns take in, as an index of entry_
    Eigen::MatrixXd block{};             ///< [(columns + rows) x columns]
    std::int64_t zeros = 0;              ///< of its block
  };
  /// Where a value of the matrix goes.
  struct Entry {
    std::int32_t row = 0, column = 0;
  };

  void order(const Matrix& pattern);
  void find_nodes();
  void merge_nodes();
  void place_entries(const Matrix& pattern);
  bool eliminate(std::size_t index, const Matrix& matrix, std::vector<Eigen::MatrixXd>& updates);

  Eigen::Index size_ = 0;
  std::vector<std::int32_t> place_;               ///< of each row of the matrix in L
  std::vector<std::int32_t> parent_;              ///< of each column in the elimination tree, -1: none
  std::vector<std::vector<std::int32_t>> upper_;  ///< rows above the diagonal of each column, while the nodes are found
  std::vector<Node> nodes_;                       ///< children before parents
  std::vector<Entry> entry_;                      ///< of each value
  std::vector<std::int32_t> position_;            ///< scratch: of each row in a front
  std::int64_t entries_ = 0;
  double operations_ = 0;
};

}  // namespace exmat::precompute
