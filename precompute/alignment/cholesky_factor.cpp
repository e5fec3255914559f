#include "precompute/alignment/cholesky_factor.h"

#include <Eigen/SparseCholesky>
#include <string>

#include "common/core/error.h"

namespace exmat::precompute {

CholeskyFactor::CholeskyFactor(const Eigen::SparseMatrix<double>& matrix, const char* what) {
  const Eigen::SimplicialLLT<Eigen::SparseMatrix<double>> factor(matrix);
  if (factor.info() != Eigen::Success) throw WorkError(std::string(what) + ": the matrix is singular");
  const auto& L = factor.matrixL().nestedExpression();
  const auto& order = factor.permutationPinv().indices();
  order_.assign(order.data(), order.data() + order.size());
  for (int column = 0; column < L.outerSize(); ++column) {
    begins_.push_back(std::ssize(values_));
    for (std::remove_cvref_t<decltype(L)>::InnerIterator entry(L, column); entry; ++entry) {
      if (entry.row() == column) {
        inverse_diagonal_.push_back(static_cast<float>(1 / entry.value()));
        continue;
      }
      rows_.push_back(static_cast<std::int32_t>(entry.row()));
      values_.push_back(static_cast<float>(entry.value()));
    }
  }
  begins_.push_back(std::ssize(values_));
}

VertexArray CholeskyFactor::solve(const VertexArray& right) const {
  using Row = Eigen::RowVector3f;
  const std::size_t n = order_.size();
  std::vector<Row> x(n);
  for (std::size_t k = 0; k < n; ++k) x[k] = right.row(order_[k]).cast<float>();
  const auto entries = [&](std::size_t column, const auto& visit) {
    for (auto at = static_cast<std::size_t>(begins_[column]); at < static_cast<std::size_t>(begins_[column + 1]); ++at)
      visit(static_cast<std::size_t>(rows_[at]), values_[at]);
  };
  for (std::size_t k = 0; k < n; ++k) {
    const Row solved = x[k] *= inverse_diagonal_[k];
    entries(k, [&](std::size_t row, float value) { x[row] -= value * solved; });
  }
  for (std::size_t k = n; k-- > 0;) {
    Row sum = x[k];
    entries(k, [&](std::size_t row, float value) { sum -= value * x[row]; });
    x[k] = sum * inverse_diagonal_[k];
  }
  VertexArray result(right.rows(), 3);
  for (std::size_t k = 0; k < n; ++k) result.row(order_[k]) = x[k].cast<double>();
  return result;
}

}  // namespace exmat::precompute
