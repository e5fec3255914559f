#pragma once

// Private to precompute/solvers.

#include <Eigen/Core>

#include "precompute/solvers/mixed_solver.h"

namespace exmat::precompute {

/// [n x count] eigenvectors of the smallest eigenvalues of K x = lambda M x in the M-complement of the null space of K
/// and of the M-orthonormal columns of `found`, within about `accuracy` in the norm of M, or as near as rounding lets
/// them be. Block Davidson (Davidson 1975; Morgan and Scott 1986): Rayleigh-Ritz in a space that grows by the residuals
/// of all wanted pairs, solved for with the factors of `solver`. That is block Lanczos on the inverse, which residuals
/// in double keep from the rounding of the factors. Throws WorkError where it does not converge.
Eigen::MatrixXd davidson_eigenvectors(const SparseMatrix& stiffness, const SparseMatrix& mass,
                                      const MixedSolver& solver, const Eigen::MatrixXd& found, Eigen::Index count,
                                      double accuracy);

}  // namespace exmat::precompute
