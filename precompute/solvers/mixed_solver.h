#pragma once

// Private to precompute/solvers.

#include <Eigen/Core>
#include <string>

#include "precompute/solvers/single_cholesky.h"

namespace exmat::precompute {

/// Solves with a symmetric positive semi-definite matrix K, whose null space is that of the M-orthonormal columns of R,
/// by factors in single precision and conjugate gradients in double, which take few steps. With a null space the
/// factors are of K without as many rows and columns: what is left out holds the body.
class MixedSolver {
 public:
  /// M R is `mass_times_null_space`. `block` rows of K each are a vertex's.
  MixedSolver(SparseMatrix matrix, Eigen::MatrixXd null_space, Eigen::MatrixXd mass_times_null_space, int block,
              std::shared_ptr<const Elimination> plan);

  /// Empty, or why the factors do not serve. Where K has more null vectors than R, they do not.
  const std::string& objection() const { return objection_; }

  Eigen::Index nullity() const { return null_space_.cols(); }

  /// [n x k] X with K X = (I - M R R^T) B and R^T M X = 0. Throws WorkError where the iteration does not converge.
  RowMatrix solve(RowMatrix right_hand_sides) const;

  /// The same, to the precision of the factors, in place.
  void precondition(RowMatrix& right_hand_sides) const;

 private:
  struct Outcome {
    RowMatrix solutions;
    bool converged = false;
    int steps = 0;
  };
  /// Into `solutions`, whose memory is used again where it fits; the null vectors have no share in what is given.
  void precondition(const RowMatrix& residual, RowMatrix& solutions) const;
  Outcome iterate(RowMatrix right_hand_sides, int most) const;
  std::string object() const;

  SparseMatrix matrix_;
  RowMatrix null_space_, mass_null_space_;
  SingleCholesky factors_;
  std::string objection_;
};

}  // namespace exmat::precompute
