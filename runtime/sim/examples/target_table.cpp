#include "runtime/sim/examples/target_table.h"

#include <algorithm>

namespace exmat::runtime {

TargetTable::TargetTable(const TargetTableData& data)
    : degree_(static_cast<int>(data.degree)),
      examples_(data.exponents.cols()),
      modes_(data.control_points.cols()),
      knots_(data.knots) {
  if (exmat::is_of_pairs(data.exponents)) {
    pairs_.emplace(data);
    return;
  }
  basis_ = BernsteinBasis(degree_, static_cast<int>(examples_));
  lower_basis_ = BernsteinBasis(degree_ - 1, basis_.weights());
  control_points_ = AlignedArray(data.control_points.rows() * padded(modes_));
  raised_.resize(lower_basis_.size(), basis_.weights());
  Eigen::Map<RowMatrix>(control_points_.data(), data.control_points.rows(), padded(modes_)).leftCols(modes_) =
      data.control_points;
  const IndexMatrix lower = lower_basis_.exponents();
  for (Eigen::Index n = 0; n < lower.rows(); ++n)
    for (int k = 0; k < basis_.weights(); ++k)
      raised_(n, k) =
          static_cast<int>(basis_.number(lower.row(n).transpose() + Eigen::VectorXi::Unit(basis_.weights(), k)));
}

TargetTable::Workspace TargetTable::make_workspace() const {
  if (pairs_) {
    Workspace workspace;
    workspace.pairs = pairs_->make_workspace();
    return workspace;
  }
  return {basis_.make_workspace(),
          lower_basis_.make_workspace(),
          Eigen::VectorXd::Zero(basis_.size()),
          Eigen::VectorXd::Zero(lower_basis_.size()),
          AlignedArray(modes_),
          Eigen::VectorXd::Zero(basis_.weights()),
          {}};
}

Eigen::Index TargetTable::piece(const Eigen::VectorXd& weights) const noexcept {
  const double* inner = knots_.data() + 1;
  return std::upper_bound(inner, inner + pieces() - 1, weights[1]) - inner;
}

// The piece, and the weights of its ends.
Eigen::Index TargetTable::locate(const Eigen::VectorXd& weights, Eigen::VectorXd& local) const noexcept {
  local = weights;
  if (pieces() == 1) return 0;
  const Eigen::Index i = piece(weights);
  local[1] = std::clamp((weights[1] - knots_[i]) / (knots_[i + 1] - knots_[i]), 0.0, 1.0);
  local[0] = 1 - local[1];
  return i;
}

// sum = the control points of the piece times the values.
void TargetTable::combine(Eigen::Index piece, Workspace& workspace) const noexcept {
  const Eigen::Index stride = padded(modes_);
  kernels().matrix_vector(control_points_.data() + piece * basis_.size() * stride, stride, basis_.size(), stride,
                          workspace.values.data(), workspace.sum.data());
}

void TargetTable::evaluate(const Eigen::VectorXd& weights, Workspace& workspace,
                           Eigen::VectorXd& target) const noexcept {
  if (pairs_) {
    pairs_->evaluate(weights, workspace.pairs, target);
    return;
  }
  const Eigen::Index piece = locate(weights, workspace.local);
  basis_.values(workspace.local, workspace.basis, workspace.values);
  combine(piece, workspace);
  target = Eigen::Map<const Eigen::VectorXd>(workspace.sum.data(), modes_);
}

Eigen::Index TargetTable::lanes_scratch() const noexcept {
  return basis_.size() * kLanes + lane_bernstein_scratch(degree(), examples());
}

void TargetTable::evaluate_lanes(const double* weights, double* scratch, double* target) const noexcept {
  double* const values = scratch + lane_bernstein_scratch(degree(), examples());
  kernels().lanes_bernstein(basis_.arrays(), weights, scratch, values);
  kernels().lanes_matrix_product(control_points_.data(), modes_, basis_.size(), padded(modes_), values, target);
}

// dp/dw_k = D sum_b B_b(w) P_(b + 1_k) for independent weights, which along w itself gives D p. In a piece those are
// its own weights; the difference of the two columns is dp/ds = (t_i+1 - t_i) dp/dt.
void TargetTable::differentiate(const Eigen::VectorXd& weights, Workspace& workspace,
                                Eigen::MatrixXd& jacobian) const noexcept {
  const Eigen::Index piece = locate(weights, workspace.local);
  lower_basis_.values(workspace.local, workspace.lower_basis, workspace.lower_values);
  for (Eigen::Index k = 0; k < examples(); ++k) {
    workspace.values.setZero();
    for (Eigen::Index n = 0; n < raised_.rows(); ++n) workspace.values[raised_(n, k)] = workspace.lower_values[n];
    combine(piece, workspace);
    jacobian.col(k) = degree() * Eigen::Map<const Eigen::VectorXd>(workspace.sum.data(), modes_);
  }
  if (pieces() > 1) {
    jacobian.col(1) = (jacobian.col(1) - jacobian.col(0)) / (knots_[piece + 1] - knots_[piece]);
    jacobian.col(0).setZero();
  }
}

void TargetTable::derivative(const Eigen::VectorXd& weights, Workspace& workspace,
                             Eigen::MatrixXd& jacobian) const noexcept {
  if (pairs_)
    pairs_->derivative(weights, workspace.pairs, jacobian);
  else
    differentiate(weights, workspace, jacobian);
  Eigen::Map<Eigen::VectorXd> along((pairs_ ? workspace.pairs.sum : workspace.sum).data(), modes_);
  along.noalias() = jacobian * weights;
  jacobian.colwise() -= along;
}

}  // namespace exmat::runtime
