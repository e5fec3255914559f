#pragma once

#include <Eigen/Core>

#include "common/core/arrays.h"
#include "runtime/kernels/kernels.h"

namespace exmat::runtime {

/// The Bernstein polynomials B_a(w) = D!/(a_1! ... a_K!) w_1^a_1 ... w_K^a_K of one degree on the simplex of K weights,
/// numbered by their exponents a in lexicographic, descending order: (D, 0, ...), (D-1, 1, ...), ... Farin 1986.
/// Immutable; values() neither allocates nor throws.
class BernsteinBasis {
 public:
  static constexpr int kMostDegree = 60;

  struct Workspace {
    Eigen::MatrixXd powers;  ///< (D+1) x K, column k: w_k^0 ... w_k^D; column K - 2 the other way round
  };

  BernsteinBasis() = default;

  /// `degree` in [0, kMostDegree], `weights` K >= 2.
  BernsteinBasis(int degree, int weights);

  Workspace make_workspace() const;

  int degree() const { return degree_; }
  int weights() const { return weights_; }
  Eigen::Index size() const { return size_; }  ///< N = (D + K - 1)! / (D! (K - 1)!)

  /// [N x K], in order.
  IndexMatrix exponents() const;
  /// Number of the polynomial with these exponents [K], which add up to D.
  Eigen::Index number(const Eigen::VectorXi& exponents) const;

  /// `values` [N] at w [K], w >= 0. Values far below rounding, near corners and edges, become exactly zero.
  void values(const Eigen::VectorXd& w, Workspace& workspace, Eigen::Ref<Eigen::VectorXd> values) const noexcept;

  /// The same of kLanes bodies side by side: see Kernels::lanes_bernstein.
  BernsteinArrays arrays() const noexcept;

 private:
  void fill_powers(const Eigen::VectorXd& w, Workspace& workspace) const noexcept;
  void expand(int k, int left, double product, const Workspace& workspace, double*& next) const noexcept;

  int degree_ = 0;
  int weights_ = 0;
  Eigen::Index size_ = 0;
  Eigen::MatrixXd binomials_;  ///< (D+1) x (D+1): n over a at (a, n)
  Eigen::MatrixXi sums_;       ///< (K+1) x (D+1): in how many ways k exponents can add up to m
};

}  // namespace exmat::runtime
