#pragma once

#include <Eigen/Core>
#include <vector>

namespace exmat::precompute {

/// Two shapes' eigenvalues, and coefficients of corresponding functions on them, to be coupled.
struct CouplingProblem {
  Eigen::VectorXd lambda_a, lambda_b;  ///< k_a <= k_b
  Eigen::MatrixXd F, G;                ///< k_a x q, k_b x q
  double coupling = 1;                 ///< mu, of the coupling term
};

/// A [k_a x k_a] and B [k_b x k_a], orthonormal columns: the bases Phi_a A and Phi_b B correspond function by function.
struct CoupledBases {
  Eigen::MatrixXd A, B;
  std::vector<double> objective;  ///< before the first step and after each

  /// C = A B^T [k_a x k_b].
  Eigen::MatrixXd functional_map() const { return A * B.transpose(); }
};

/// f(A, B) = off(A^T L_a A) + off(B^T L_b B) + mu |F^T A - G^T B|^2, off(X) the sum of the squares off the diagonal, L
/// the eigenvalues over the largest of a, so that mu does not depend on scale. Kovnatsky et al. 2013, section 4.
double coupling_objective(const CouplingProblem& problem, const Eigen::MatrixXd& A, const Eigen::MatrixXd& B);

/// Its derivatives in A and B, unconstrained.
struct CouplingGradient {
  Eigen::MatrixXd A, B;
};
CouplingGradient coupling_gradient(const CouplingProblem& problem, const Eigen::MatrixXd& A, const Eigen::MatrixXd& B);

/// Coupled quasi-harmonic bases: descent on the Stiefel manifolds, polar retraction, Armijo's rule, from A = I and
/// B = start^T, start [k_a x k_b] a functional map with orthonormal rows.
CoupledBases couple_bases(const CouplingProblem& problem, const Eigen::MatrixXd& start);

}  // namespace exmat::precompute
