#pragma once

// Private to precompute/solvers: eigenpairs to the rounding of double where products in double are too coarse.

#include <Eigen/Core>

#include "precompute/solvers/eigenpairs.h"

namespace exmat::precompute {

using ExtendedMatrix = Eigen::Matrix<long double, Eigen::Dynamic, Eigen::Dynamic>;

/// Matrix times columns, summed in long double.
ExtendedMatrix extended_product(const SparseMatrix& matrix, const ExtendedMatrix& columns);

/// x^T K x / x^T M x, summed in long double.
double rayleigh_quotient(const SparseMatrix& stiffness, const SparseMatrix& mass, const Eigen::VectorXd& x);

/// |K x - lambda M x| / (|K| |x| + |lambda M| |x|) of each pair, summed in long double; matrix norms are the largest
/// row sums. Rounding alone leaves about 1e-16.
Eigen::VectorXd backward_errors(const SparseMatrix& stiffness, const SparseMatrix& mass, const Eigen::VectorXd& values,
                                const Eigen::MatrixXd& vectors);

/// Most that eigenvalues change, relative, where each entry of K is rounded to double: eps |x|^T |K| |x| / x^T K x, the
/// largest of all pairs. No solver does better on a K that was assembled in double.
double rounding_share(const SparseMatrix& stiffness, const SparseMatrix& mass, const Eigen::VectorXd& values,
                      const Eigen::MatrixXd& vectors);

struct RefinedPairs {
  Eigen::VectorXd values;
  Eigen::MatrixXd vectors;  ///< M-orthonormal
  double change = 0;        ///< largest |lambda K^-1 M x - x|, in the norm of M, of the pairs before the last step
};

/// Inverse iteration and Rayleigh-Ritz with residuals and products in long double: what the factors lose in double
/// comes back by iterative refinement (Wilkinson 1963). `values` and `vectors` are those found in double.
RefinedPairs refine(const SparseMatrix& stiffness, const SparseMatrix& mass, const SemidefiniteSolver& solver,
                    const Eigen::VectorXd& values, const Eigen::MatrixXd& vectors);

}  // namespace exmat::precompute
