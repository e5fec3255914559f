#include "runtime/sim/examples/pair_table.h"

#include <algorithm>

namespace exmat::runtime {
namespace {

double binomial(int n, int k) {
  double value = 1;
  for (int i = 1; i <= k; ++i) value *= static_cast<double>(n - k + i) / i;
  return value;
}

}  // namespace

PairTable::PairTable(const TargetTableData& data)
    : modes_(data.control_points.cols()),
      degree_(static_cast<int>(data.degree)),
      exponents_(Eigen::MatrixX3i::Zero(data.exponents.rows(), 3)),
      factors_(data.exponents.rows()),
      control_points_(data.control_points.rows() * padded(modes_)) {
  Eigen::Map<RowMatrix>(control_points_.data(), data.control_points.rows(), padded(modes_)).leftCols(modes_) =
      data.control_points;
  for (Eigen::Index n = 0; n < exponents_.rows(); ++n) {
    Term own{.degree = data.exponents.row(n).sum(), .begin = n};
    for (int k = 1; k < data.exponents.cols(); ++k) {
      if (data.exponents(n, k) == 0) continue;
      (own.first == 0 ? own.first : own.second) = k;
      exponents_(n, own.second == 0 ? 1 : 2) = data.exponents(n, k);
    }
    exponents_(n, 0) = data.exponents(n, 0);
    factors_[n] = binomial(own.degree, exponents_(n, 1)) * binomial(own.degree - exponents_(n, 1), exponents_(n, 2));
    if (terms_.empty() || terms_.back().first != own.first || terms_.back().second != own.second) terms_.push_back(own);
    ++terms_.back().size;
  }
}

PairTable::Workspace PairTable::make_workspace() const {
  return {Eigen::VectorXd::Zero(rows()), Eigen::MatrixXd::Ones(degree_ + 1, 3), AlignedArray(modes_)};
}

void PairTable::fill_powers(const Term& term, const Eigen::VectorXd& weights, Workspace& workspace) const noexcept {
  const double first = term.first > 0 ? weights[term.first] : 0, second = term.second > 0 ? weights[term.second] : 0;
  const double bases[3] = {std::max(0.0, 1 - first - second), first, second};
  for (int i = 0; i < 3; ++i)
    for (int a = 1; a <= term.degree; ++a) workspace.powers(a, i) = workspace.powers(a - 1, i) * bases[i];
}

// Adds the control points of some rows times the values.
void PairTable::add_rows(Eigen::Index begin, Eigen::Index end, Workspace& workspace,
                         Eigen::Ref<Eigen::VectorXd> target) const noexcept {
  if (begin == end) return;
  const Eigen::Index stride = padded(modes_);
  kernels().matrix_vector(control_points_.data() + begin * stride, stride, end - begin, stride,
                          workspace.values.data() + begin, workspace.sum.data());
  target += Eigen::Map<const Eigen::VectorXd>(workspace.sum.data(), modes_);
}

void PairTable::evaluate(const Eigen::VectorXd& weights, Workspace& workspace, Eigen::VectorXd& target) const noexcept {
  target.setZero();
  const Eigen::MatrixXd& powers = workspace.powers;
  Eigen::Index begin = 0, end = 0;  // rows of terms behind each other that are not zero
  for (const Term& term : terms_) {
    if ((term.first > 0 && weights[term.first] == 0) || (term.second > 0 && weights[term.second] == 0)) continue;
    if (term.begin != end) {
      add_rows(begin, end, workspace, target);
      begin = term.begin;
    }
    end = term.begin + term.size;
    fill_powers(term, weights, workspace);
    for (Eigen::Index n = term.begin; n < end; ++n)
      workspace.values[n] =
          factors_[n] * powers(exponents_(n, 0), 0) * powers(exponents_(n, 1), 1) * powers(exponents_(n, 2), 2);
  }
  add_rows(begin, end, workspace, target);
}

void PairTable::derivative(const Eigen::VectorXd& weights, Workspace& workspace,
                           Eigen::MatrixXd& jacobian) const noexcept {
  jacobian.setZero();
  const Eigen::MatrixXd& powers = workspace.powers;
  for (const Term& term : terms_) {
    fill_powers(term, weights, workspace);
    const auto slope = [&](Eigen::Index n, int i) {  // of a power
      return exponents_(n, i) == 0 ? 0.0 : exponents_(n, i) * powers(exponents_(n, i) - 1, i);
    };
    for (const int i : {1, 2}) {
      const int k = i == 1 ? term.first : term.second;
      if (k == 0) continue;
      for (Eigen::Index n = term.begin; n < term.begin + term.size; ++n) {
        const auto a = exponents_.row(n);
        workspace.values[n] =
            factors_[n] * powers(a[3 - i], 3 - i) * (powers(a[0], 0) * slope(n, i) - slope(n, 0) * powers(a[i], i));
      }
      add_rows(term.begin, term.begin + term.size, workspace, jacobian.col(k));
    }
  }
}

}  // namespace exmat::runtime
