#pragma once

#include <Eigen/Core>

#include "common/core/arrays.h"

namespace exmat::runtime {

/// Example weights w(q): min 1/2 w^T G w - h(q)^T w subject to sum w = 1, w >= 0, h(q) = h0 + hq q.
/// docs/step_in_detail.md, "Weights". That is the point of the convex hull of the K examples nearest to the current
/// descriptor, found exactly by the algorithm of Wolfe 1976 in Gram form, for any K and for repeated or affinely
/// dependent examples. Deterministic; no call allocates or throws.
class ExampleWeights {
 public:
  struct Workspace {
    Eigen::VectorXd load, affine, slopes;  ///< K each
    Eigen::MatrixXd system;                ///< K x K
    Eigen::VectorXi corral;                ///< affinely independent examples of positive weight, the first ones used
    Eigen::VectorXi state;                 ///< K: whether each example is out, in the corral or refused
  };

  ExampleWeights() = default;

  /// `gram` [K x K], `h0` [K], `hq` [K x r]; K >= 1.
  ExampleWeights(const RowMatrix& gram, const Eigen::VectorXd& h0, const RowMatrix& hq);

  Workspace make_workspace() const;

  Eigen::Index examples() const { return gram_.rows(); }

  /// `weights` [K] at the pose q [r].
  void solve(const Eigen::VectorXd& q, Workspace& workspace, Eigen::VectorXd& weights) const noexcept;

 private:
  bool solve_affine(Workspace& workspace, int count) const noexcept;
  int shrink_to_simplex(Workspace& workspace, int count, Eigen::VectorXd& weights) const noexcept;

  // Relative to example 0, which changes the objective by a constant on the simplex and keeps the digits of the
  // differences.
  Eigen::MatrixXd gram_;  ///< (e_i - e_0)^T (e_j - e_0)
  Eigen::VectorXd h0_;    ///< (e_k - e_0)^T (c_rest - e_0)
  RowMatrix hq_;          ///< (e_k - e_0)^T T
};

/// w_0 <- bias w_0, the rest of it shared equally among the others; nothing for K = 1. `bias` in [0, 1].
/// docs/step_in_detail.md, "Weights".
void apply_example_bias(double bias, Eigen::VectorXd& weights) noexcept;

}  // namespace exmat::runtime
