#include "precompute/targets/table_error.h"

#include <algorithm>

namespace exmat::precompute {

using runtime::BernsteinBasis;
using runtime::TargetSolver;
using runtime::TargetTable;

void TargetSamples::append(const TargetSamples& more) {
  const Eigen::Index before = weights.rows(), count = more.weights.rows();
  weights.conservativeResize(before + count, more.weights.cols());
  minima.conservativeResize(before + count, more.minima.cols());
  weights.bottomRows(count) = more.weights;
  minima.bottomRows(count) = more.minima;
}

TableError::TableError(const TargetSolver& target, Eigen::Index examples) : basis_(target.basis()) {
  for (Eigen::Index k = 0; k < examples; ++k) scale_ = std::max(scale_, target.example(k).norm());
}

RowMatrix TableError::decode(const TargetTable& table, const RowMatrix& weights) const {
  RowMatrix decoded(weights.rows(), basis_.cols());
  auto workspace = table.make_workspace();
  Eigen::VectorXd target(table.modes());
  for (Eigen::Index i = 0; i < weights.rows(); ++i) {
    table.evaluate(weights.row(i).transpose(), workspace, target);
    decoded.row(i) = basis_.solve(target).transpose();
  }
  return decoded;
}

Eigen::VectorXd TableError::errors(const TargetTable& table, const TargetSamples& samples) const {
  return (decode(table, samples.weights) - samples.minima).rowwise().norm() / scale_;
}

Eigen::MatrixXd collocation(const BernsteinBasis& basis, const RowMatrix& weights) {
  Eigen::MatrixXd transposed(basis.size(), weights.rows());
  auto workspace = basis.make_workspace();
  for (Eigen::Index i = 0; i < weights.rows(); ++i)
    basis.values(weights.row(i).transpose(), workspace, transposed.col(i));
  return transposed.transpose();
}

}  // namespace exmat::precompute
