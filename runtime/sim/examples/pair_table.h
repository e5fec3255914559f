#pragma once

#include <Eigen/Core>
#include <vector>

#include "common/model/reduced_model.h"
#include "runtime/kernels/aligned_array.h"

namespace exmat::runtime {

/// Targets of many examples as terms of one and two of them: t(w) = t_0 + sum_k f_k(w_k) + sum g_kl(w_k, w_l) over some
/// pairs without the rest pose, each a polynomial in Bernstein form of the weights of the one or two and of what these
/// leave of 1, zero where one of the weights is. docs/method.md, "Targets of many examples". Immutable; no evaluation
/// allocates or throws.
class PairTable {
 public:
  struct Workspace {
    Eigen::VectorXd values;  ///< rows, of the control points
    Eigen::MatrixXd powers;  ///< (D+1) x 3, of what is left, of the first and of the second weight
    AlignedArray sum;        ///< r, padded
  };

  PairTable() = default;

  /// `data` as TargetTableData has it, whose first row of exponents is zero.
  explicit PairTable(const TargetTableData& data);

  Workspace make_workspace() const;

  Eigen::Index rows() const { return factors_.size(); }

  /// `target` [r]; weights [K] >= 0 add up to 1. Terms of weights that are zero take no time.
  void evaluate(const Eigen::VectorXd& weights, Workspace& workspace, Eigen::VectorXd& target) const noexcept;

  /// `jacobian` [r x K], columns d/dw_k where what is left follows from the weights; the first one is zero.
  void derivative(const Eigen::VectorXd& weights, Workspace& workspace, Eigen::MatrixXd& jacobian) const noexcept;

 private:
  struct Term {
    int first = 0, second = 0;  ///< examples, 0: none
    int degree = 0;
    Eigen::Index begin = 0, size = 0;  ///< its rows
  };
  void fill_powers(const Term& term, const Eigen::VectorXd& weights, Workspace& workspace) const noexcept;
  void add_rows(Eigen::Index begin, Eigen::Index end, Workspace& workspace,
                Eigen::Ref<Eigen::VectorXd> target) const noexcept;

  Eigen::Index modes_ = 0;
  int degree_ = 0;
  std::vector<Term> terms_;
  Eigen::MatrixX3i exponents_;   ///< of what is left, of the first and of the second weight
  Eigen::VectorXd factors_;      ///< multinomial coefficients
  AlignedArray control_points_;  ///< rows x padded(r)
};

}  // namespace exmat::runtime
