#pragma once

#include <Eigen/Core>

#include "precompute/solvers/semidefinite_solver.h"

namespace exmat::precompute {

/// Eigenpairs of K x = lambda M x.
struct Eigenpairs {
  Eigen::VectorXd values;   ///< k, ascending
  Eigen::MatrixXd vectors;  ///< n x k, M-orthonormal, signs fixed (see fix_signs)
};

/// The `count` smallest eigenpairs of K x = lambda M x outside the null space of K, by SLEPc's Krylov-Schur on the
/// inverse that `solver` has factored, or by block Davidson with factors in single precision. No copy of a multiple
/// eigenvalue is missed: the search is repeated in the complement of what was found until nothing smaller turns up.
/// Residuals |K x - lambda M x| / |lambda M x| are at most 1e-9, or pairs are refined in long double until |lambda K^-1
/// M x - x| is, in the norm of M. Throws WorkError when the search does not converge, IllConditioned when the
/// refinement does not.
Eigenpairs smallest_eigenpairs(const SparseMatrix& stiffness, const SparseMatrix& mass,
                               const SemidefiniteSolver& solver, Eigen::Index count);

/// Makes the first entry within 1e-6 of the largest magnitude of each column positive.
void fix_signs(Eigen::MatrixXd& columns);

/// Eigenvalues are taken as one cluster where neighbours differ by less than this, relative: tessellations split exact
/// pairs by as much.
constexpr double kClusterGap = 0.02;

/// True if a cut behind the first `count` of the values splits a cluster; `values` holds at least one more.
bool splits_cluster(const Eigen::VectorXd& values, Eigen::Index count);

/// The next larger count whose cut splits no cluster, or the number of values where there is none.
Eigen::Index next_uncut(const Eigen::VectorXd& values, Eigen::Index count);

}  // namespace exmat::precompute
