#pragma once

#include <Eigen/Core>

#include "common/core/arrays.h"
#include "runtime/kernels/aligned_array.h"

namespace exmat::runtime {

/// Example weights w(q): min 1/2 w^T G w - h(q)^T w subject to sum w = 1, w >= 0, h(q) = h0 + hq q.
/// docs/step_in_detail.md, "Weights". That is the point of the convex hull of the K examples nearest to the current
/// descriptor, the best of few candidates where examples are few and well apart, else found by the algorithm of Wolfe
/// 1976 in Gram form, for any K and for repeated or affinely dependent examples. Exact and deterministic; no call
/// allocates or throws.
class ExampleWeights {
 public:
  struct Workspace {
    Eigen::VectorXd load;            ///< padded(K)
    Eigen::VectorXd affine, slopes;  ///< K each
    Eigen::MatrixXd system;          ///< K x K, Cholesky factor of the corral
    Eigen::VectorXd forward;         ///< K, of its right side
    int factored = 0;                ///< examples of the corral, from the first on, whose rows it has
    Eigen::VectorXi corral;          ///< affinely independent examples of positive weight, the first ones used
    Eigen::VectorXi state;           ///< K: whether each example is out, in the corral or refused
  };

  ExampleWeights() = default;

  /// `gram` [K x K], `h0` [K], `hq` [K x r]; K >= 1.
  ExampleWeights(const RowMatrix& gram, const Eigen::VectorXd& h0, const RowMatrix& hq);

  Workspace make_workspace() const;

  Eigen::Index examples() const { return gram_.rows(); }

  /// The load of a pose relative to example 0, h(q) = h0 + hq q: h0 [K] and hq [padded(K) x r] by columns, whose first
  /// numbers are zero.
  const Eigen::VectorXd& load_at_rest() const { return h0_; }
  const Eigen::MatrixXd& load_slope() const { return slope_; }

  /// The minima over the affine hulls of all 2^K - 1 sets of examples, as functions of the load: weights of those in a
  /// set, and how much steeper than in it the descent towards the others is. The solution is the one where none of
  /// these is negative. There are none for many examples, and for such that are affinely dependent or nearly so.
  bool has_candidates() const { return candidate_count_ > 0; }
  WeightCandidates candidates() const {
    return {examples(), candidate_count_, candidate_numbers_.data(), candidate_members_.data()};
  }

  /// `weights` [K] at the pose q [r].
  void solve(const Eigen::VectorXd& q, Workspace& workspace, Eigen::VectorXd& weights) const noexcept;

 private:
  void solve_by_sets(Workspace& workspace, Eigen::VectorXd& weights) const noexcept;
  bool solve_affine(Workspace& workspace, int count) const noexcept;
  int shrink_to_simplex(Workspace& workspace, int count, Eigen::VectorXd& weights) const noexcept;
  void build_candidates();
  void set_candidate(Eigen::Index n, unsigned members);

  // Relative to example 0, which changes the objective by a constant on the simplex and keeps the digits of the
  // differences.
  Eigen::MatrixXd gram_;   ///< (e_i - e_0)^T (e_j - e_0)
  Eigen::VectorXd h0_;     ///< (e_k - e_0)^T (c_rest - e_0)
  Eigen::MatrixXd slope_;  ///< (e_k - e_0)^T T, padded

  Eigen::Index candidate_count_ = 0;
  AlignedArray candidate_numbers_, candidate_members_;  ///< see WeightCandidates
};

/// w_0 <- bias w_0, the rest of it shared equally among the others; nothing for K = 1. `bias` in [0, 1].
/// docs/step_in_detail.md, "Weights".
void apply_example_bias(double bias, Eigen::VectorXd& weights) noexcept;

}  // namespace exmat::runtime
