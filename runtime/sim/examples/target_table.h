#pragma once

#include <Eigen/Core>
#include <optional>

#include "common/model/reduced_model.h"
#include "runtime/kernels/aligned_array.h"
#include "runtime/sim/examples/bernstein_basis.h"
#include "runtime/sim/examples/pair_table.h"

namespace exmat::runtime {

/// The targets p*(w) of K >= 2 examples from a table, exact at the examples: one polynomial on the simplex of weights,
/// so infinitely smooth, or for K = 2 several pieces, continuous with their slopes; of many examples terms of one and
/// two of them. docs/method.md, "Table of targets".
/// Immutable; no evaluation allocates or throws.
class TargetTable {
 public:
  struct Workspace {
    BernsteinBasis::Workspace basis, lower_basis;  ///< degree D and D - 1
    Eigen::VectorXd values;                        ///< N, coefficients of the control points
    Eigen::VectorXd lower_values;                  ///< as many as polynomials of degree D - 1
    AlignedArray sum;                              ///< r, padded
    Eigen::VectorXd local;                         ///< K, weights within the piece
    PairTable::Workspace pairs;
  };

  TargetTable() = default;

  /// `data` as TargetTableData has it, degree in [1, BernsteinBasis::kMostDegree].
  explicit TargetTable(const TargetTableData& data);

  Workspace make_workspace() const;

  int degree() const { return degree_; }                     ///< that of the largest term
  Eigen::Index examples() const { return examples_; }        ///< K
  Eigen::Index modes() const { return modes_; }              ///< r
  Eigen::Index pieces() const { return knots_.size() - 1; }  ///< P
  bool is_of_pairs() const { return pairs_.has_value(); }
  Eigen::Index piece_rows() const { return pairs_ ? pairs_->rows() : basis_.size(); }  ///< control points of a piece

  /// The piece in [0, P) that serves these weights [K]; that which begins there at a knot.
  Eigen::Index piece(const Eigen::VectorXd& weights) const noexcept;

  /// `target` [r] = p*(w) in reduced coordinates; weights [K] >= 0 add up to 1.
  void evaluate(const Eigen::VectorXd& weights, Workspace& workspace, Eigen::VectorXd& target) const noexcept;

  /// Evaluates kLanes bodies side by side (kernels.h): weights [K] and target [r] of each, for one polynomial;
  /// scratch lanes_scratch().
  void evaluate_lanes(const double* weights, double* scratch, double* target) const noexcept;
  Eigen::Index lanes_scratch() const noexcept;

  /// `jacobian` [r x K] = d/dw p*(w / sum w) where the weights add up to 1. Along tangents of the simplex (dw adds up
  /// to zero) it is dp*; across, jacobian w = 0, which settles the vector that may be added to all columns.
  void derivative(const Eigen::VectorXd& weights, Workspace& workspace, Eigen::MatrixXd& jacobian) const noexcept;

 private:
  Eigen::Index locate(const Eigen::VectorXd& weights, Eigen::VectorXd& local) const noexcept;
  void combine(Eigen::Index piece, Workspace& workspace) const noexcept;
  void differentiate(const Eigen::VectorXd& weights, Workspace& workspace, Eigen::MatrixXd& jacobian) const noexcept;

  int degree_ = 0;
  Eigen::Index examples_ = 0;           ///< K
  std::optional<PairTable> pairs_;      ///< in place of what follows but modes and knots
  BernsteinBasis basis_, lower_basis_;  ///< degree D and D - 1
  Eigen::Index modes_ = 0;              ///< r
  Eigen::VectorXd knots_;               ///< P + 1
  AlignedArray control_points_;         ///< P N x padded(r)
  Eigen::MatrixXi raised_;              ///< K columns, number of b + 1_k for each b of degree D - 1
};

}  // namespace exmat::runtime
