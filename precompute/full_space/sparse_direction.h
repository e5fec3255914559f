#pragma once

#include <functional>

#include "precompute/full_space/mesh_elasticity.h"
#include "precompute/full_space/supernodal_cholesky.h"

namespace exmat::precompute {

/// Solves H x = b for the Hessians of one step after the other: sparse Cholesky L L^T (its ordering and symbolic part
/// once) as the preconditioner of conjugate gradients. With the factors of H itself that takes one iteration; what is
/// not in the matrix, such as a low-rank term, one for each eigenvalue that it moves; and factors of an earlier Hessian
/// serve for as long as that costs less than new ones.
class SparseDirection {
 public:
  /// All matrices have this pattern.
  explicit SparseDirection(const LowerTriangle& pattern);
  SparseDirection(const SparseDirection&) = delete;
  SparseDirection& operator=(const SparseDirection&) = delete;

  using Product = std::function<Eigen::VectorXd(const Eigen::VectorXd&)>;

  /// `x` so that |H x - b| <= 1e-5 |b|; H is `product`, of which `matrix` is all or most. False, x of no use, where
  /// `matrix` is not positive definite as far as its factorisation or the iterations see.
  bool solve(const LowerTriangle& matrix, const Product& product, const Eigen::VectorXd& b, Eigen::VectorXd& x);

  /// Adds to the diagonal of `matrix` until solve() succeeds. False where nothing helps.
  bool solve_shifted(LowerTriangle& matrix, const Product& product, const Eigen::VectorXd& b, Eigen::VectorXd& x);

  int factorisations() const { return factorisations_; }
  int iterations() const { return iterations_; }

 private:
  enum class Outcome { kSolved, kTooLong, kIndefinite };
  Outcome iterate(const Product& product, const Eigen::VectorXd& b, int most, Eigen::VectorXd& x);
  bool factorise(const LowerTriangle& matrix);

  SupernodalCholesky factors_;
  bool has_factors_ = false;
  int worthwhile_;  // iterations that cost less than a factorisation
  int factorisations_ = 0, iterations_ = 0;
};

}  // namespace exmat::precompute
