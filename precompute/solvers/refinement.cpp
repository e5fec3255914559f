#include "precompute/solvers/refinement.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "common/core/decompositions.h"

namespace exmat::precompute {
namespace {

// Change of a solution by one more step of iterative refinement, relative: nothing is left to gain.
constexpr double kSettled = 8 * std::numeric_limits<double>::epsilon();
constexpr int kMostRefinements = 10;  // two do, unless the factors have hardly a digit
constexpr int kMostSteps = 4;         // of inverse iteration; one and a second that sees no change do
constexpr double kUnchanged = 1e-12;

double largest_row_sum(const SparseMatrix& matrix) {
  double largest = 0;
  for (Eigen::Index row = 0; row < matrix.rows(); ++row) {
    double sum = 0;
    for (SparseMatrix::InnerIterator entry(matrix, row); entry; ++entry) sum += std::abs(entry.value());
    largest = std::max(largest, sum);
  }
  return largest;
}

// Sizes of columns in the norm of M.
Eigen::VectorXd sizes(const SparseMatrix& mass, const Eigen::MatrixXd& columns) {
  return columns.cwiseProduct(mass * columns).colwise().sum().cwiseMax(0).cwiseSqrt().transpose();
}

// K^-1 B. In long double: the rounding of displacements to double strains flat tets.
ExtendedMatrix solve_refined(const SparseMatrix& stiffness, const SparseMatrix& mass, const SemidefiniteSolver& solver,
                             const ExtendedMatrix& loads) {
  ExtendedMatrix solutions = solver.solve(loads.cast<double>()).cast<long double>();
  double last = std::numeric_limits<double>::infinity();
  for (int pass = 0; pass < kMostRefinements; ++pass) {
    const ExtendedMatrix left = loads - extended_product(stiffness, solutions);
    const Eigen::MatrixXd step = solver.solve(left.cast<double>());
    solutions += step.cast<long double>();
    const double share = sizes(mass, step).cwiseQuotient(sizes(mass, solutions.cast<double>())).maxCoeff();
    if (share <= kSettled || share > last / 2) break;
    last = share;
  }
  return solutions;
}

}  // namespace

ExtendedMatrix extended_product(const SparseMatrix& matrix, const ExtendedMatrix& columns) {
  ExtendedMatrix product = ExtendedMatrix::Zero(matrix.rows(), columns.cols());
#pragma omp parallel for schedule(static)
  for (Eigen::Index row = 0; row < matrix.rows(); ++row)
    for (Eigen::Index k = 0; k < columns.cols(); ++k) {
      long double sum = 0;
      for (SparseMatrix::InnerIterator entry(matrix, row); entry; ++entry)
        sum += static_cast<long double>(entry.value()) * columns(entry.col(), k);
      product(row, k) = sum;
    }
  return product;
}

double rayleigh_quotient(const SparseMatrix& stiffness, const SparseMatrix& mass, const Eigen::VectorXd& x) {
  const ExtendedMatrix column = x.cast<long double>();
  const long double energy = column.cwiseProduct(extended_product(stiffness, column)).sum();
  return static_cast<double>(energy / column.cwiseProduct(extended_product(mass, column)).sum());
}

Eigen::VectorXd backward_errors(const SparseMatrix& stiffness, const SparseMatrix& mass, const Eigen::VectorXd& values,
                                const Eigen::MatrixXd& vectors) {
  const ExtendedMatrix columns = vectors.cast<long double>();
  const ExtendedMatrix left =
      extended_product(stiffness, columns) - extended_product(mass, columns) * values.cast<long double>().asDiagonal();
  const Eigen::VectorXd scale = largest_row_sum(stiffness) + largest_row_sum(mass) * values.array().abs();
  return left.colwise().norm().transpose().cast<double>().cwiseQuotient(
      scale.cwiseProduct(vectors.colwise().norm().transpose()));
}

double rounding_share(const SparseMatrix& stiffness, const SparseMatrix& mass, const Eigen::VectorXd& values,
                      const Eigen::MatrixXd& vectors) {
  const Eigen::MatrixXd sizes = vectors.cwiseAbs();
  const SparseMatrix entries = stiffness.cwiseAbs();
  const Eigen::VectorXd lost = sizes.cwiseProduct(entries * sizes).colwise().sum().transpose();
  const Eigen::VectorXd energies =
      values.cwiseProduct(vectors.cwiseProduct(mass * vectors).colwise().sum().transpose());
  return std::numeric_limits<double>::epsilon() * lost.cwiseQuotient(energies).maxCoeff();
}

RefinedPairs refine(const SparseMatrix& stiffness, const SparseMatrix& mass, const SemidefiniteSolver& solver,
                    const Eigen::VectorXd& values, const Eigen::MatrixXd& vectors) {
  RefinedPairs pairs{values, vectors};
  for (int step = 0; step < kMostSteps; ++step) {
    const ExtendedMatrix improved =
        solve_refined(stiffness, mass, solver, extended_product(mass, pairs.vectors.cast<long double>())) *
        pairs.values.cast<long double>().asDiagonal();
    pairs.change = sizes(mass, improved.cast<double>() - pairs.vectors).maxCoeff();
    const ExtendedMatrix K = improved.transpose() * extended_product(stiffness, improved);
    const ExtendedMatrix M = improved.transpose() * extended_product(mass, improved);
    const Eigen::GeneralizedSelfAdjointEigenSolver<ExtendedMatrix> ritz(K, M);
    pairs.values = ritz.eigenvalues().cast<double>();
    pairs.vectors = (improved * ritz.eigenvectors()).cast<double>();
    if (step > 0 && pairs.change <= kUnchanged) break;
  }
  return pairs;
}

}  // namespace exmat::precompute
