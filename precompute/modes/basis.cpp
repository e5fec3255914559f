#include "precompute/modes/basis.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <cmath>
#include <string>

#include "common/core/error.h"

namespace exmat::precompute {
namespace {

// Largest displacement of the first mode in the snapshots, as a share of the body's size.
constexpr double kSnapshotAmplitude = 0.25;
// Principal components below this, relative to the largest singular value, are rounding.
constexpr double kRankTolerance = 1e-9;

Eigen::MatrixXd scaled_snapshots(const BasisInput& input) {
  const auto& lambda = input.modes.eigenvalues;
  const Eigen::Index k = lambda.size();
  const Eigen::MatrixXd first = input.system.extend(input.modes.modes.leftCols(1));
  const double largest = first.reshaped<Eigen::RowMajor>(first.rows() / 3, 3).rowwise().norm().maxCoeff();
  const double a = kSnapshotAmplitude * input.body_size / largest;
  Eigen::MatrixXd snapshots(input.modes.modes.rows(), k + input.derivatives.cols());
  for (Eigen::Index i = 0; i < k; ++i) snapshots.col(i) = a * lambda[0] / lambda[i] * input.modes.modes.col(i);
  for (Eigen::Index j = 0; j < k; ++j)
    for (Eigen::Index i = 0; i <= j; ++i) {
      const double share = (i == j ? 0.5 : 1.0) * a * a * lambda[0] * lambda[0] / (lambda[i] * lambda[j]);
      snapshots.col(k + pair_index(i, j)) = share * input.derivatives.col(pair_index(i, j));
    }
  return snapshots;
}

// Leading principal components in the M product, at most `size` of them.
Eigen::MatrixXd principal_components(const SparseMatrix& mass, const Eigen::MatrixXd& columns, Eigen::Index size) {
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> gram(columns.transpose() * (mass * columns));
  const Eigen::VectorXd values = gram.eigenvalues().reverse();
  const double smallest = kRankTolerance * kRankTolerance * values[0];
  const Eigen::Index rank = (values.array() > smallest).count();
  const Eigen::Index kept = std::min(size, rank);
  const Eigen::MatrixXd directions = gram.eigenvectors().rowwise().reverse().leftCols(kept);
  return columns * directions * values.head(kept).cwiseSqrt().cwiseInverse().asDiagonal();
}

// Q -= R (R^T M Q).
void remove_components(const SparseMatrix& mass, const Eigen::MatrixXd& orthonormal, Eigen::MatrixXd& columns) {
  if (orthonormal.cols() > 0) columns -= orthonormal * (orthonormal.transpose() * (mass * columns));
}

void orthonormalise(const SparseMatrix& mass, Eigen::MatrixXd& columns) {
  const Eigen::MatrixXd gram = columns.transpose() * (mass * columns);
  gram.llt().matrixU().solveInPlace<Eigen::OnTheRight>(columns);
}

}  // namespace

Eigen::MatrixXd modal_basis(const BasisInput& input, int size) {
  const auto& mass = input.system.mass;
  Eigen::MatrixXd basis(mass.rows(), 0);
  if (input.example_fields.cols() > 0) {
    Eigen::MatrixXd fields = input.example_fields;
    remove_components(mass, input.system.null_space, fields);
    for (auto field : fields.colwise()) field /= std::sqrt(field.dot(mass * field));
    basis = principal_components(mass, fields, std::max<Eigen::Index>(1, size / 2));
  }
  Eigen::MatrixXd snapshots = scaled_snapshots(input);
  remove_components(mass, basis, snapshots);
  const Eigen::MatrixXd components = principal_components(mass, snapshots, size - basis.cols());
  if (basis.cols() + components.cols() < size)
    throw InputError(
        {"", "/basis/size",
         "at most " + std::to_string(basis.cols() + components.cols()) + ", the number of independent snapshots",
         std::to_string(size), "ask for fewer, or for more basis.linear_modes"});
  Eigen::MatrixXd result(mass.rows(), size);
  result << basis, components;
  for (int pass = 0; pass < 2; ++pass) {
    remove_components(mass, input.system.null_space, result);
    orthonormalise(mass, result);
  }
  fix_signs(result);
  return result;
}

}  // namespace exmat::precompute
