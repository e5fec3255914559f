#include "runtime/sim/examples/example_weights.h"

#include <cmath>
#include <limits>

namespace exmat::runtime {
namespace {

enum ExampleState : int { kOut, kIn, kRefused };

constexpr double kWeightRounding = 64 * std::numeric_limits<double>::epsilon();
constexpr double kDependent = 1e-14;  // squared distance from the corral's affine hull, relative

}  // namespace

ExampleWeights::ExampleWeights(const RowMatrix& gram, const Eigen::VectorXd& h0, const RowMatrix& hq) {
  const Eigen::Index count = gram.rows();
  const Eigen::VectorXd first = gram.col(0);
  gram_ = gram - first * Eigen::RowVectorXd::Ones(count) - Eigen::VectorXd::Ones(count) * gram.row(0) +
          Eigen::MatrixXd::Constant(count, count, gram(0, 0));
  h0_ = (h0.array() - h0[0]).matrix() - (first.array() - gram(0, 0)).matrix();
  hq_ = hq.rowwise() - hq.row(0);
}

ExampleWeights::Workspace ExampleWeights::make_workspace() const {
  const Eigen::Index count = examples();
  return {Eigen::VectorXd::Zero(count),        Eigen::VectorXd::Zero(count), Eigen::VectorXd::Zero(count),
          Eigen::MatrixXd::Zero(count, count), Eigen::VectorXi::Zero(count), Eigen::VectorXi::Zero(count)};
}

void ExampleWeights::solve(const Eigen::VectorXd& q, Workspace& workspace, Eigen::VectorXd& weights) const noexcept {
  auto& [load, affine, slopes, system, corral, state] = workspace;
  load = h0_;
  load.noalias() += hq_ * q;
  Eigen::Index start = 0;
  (0.5 * gram_.diagonal() - load).minCoeff(&start);
  weights.setZero();
  weights[start] = 1;
  state.setConstant(kOut);
  state[start] = kIn;
  corral[0] = static_cast<int>(start);
  int count = 1;

  const double rounding = kWeightRounding * (gram_.cwiseAbs().maxCoeff() + load.cwiseAbs().maxCoeff());
  const auto limit = 10 * examples() + 10;  // the objective falls at every turn; the limit is for rounding and NaN
  for (Eigen::Index turn = 0; turn < limit; ++turn) {
    slopes.noalias() = gram_ * weights;
    slopes -= load;
    const double level = slopes.dot(weights);
    Eigen::Index entering = -1;
    double lowest = level - rounding;
    for (Eigen::Index k = 0; k < examples(); ++k) {
      if (state[k] != kOut || !(slopes[k] < lowest)) continue;
      lowest = slopes[k];
      entering = k;
    }
    if (entering < 0) return;
    state[entering] = kIn;
    corral[count++] = static_cast<int>(entering);
    if (!solve_affine(workspace, count)) {
      state[entering] = kRefused;
      --count;
      continue;
    }
    count = shrink_to_simplex(workspace, count, weights);
  }
}

/// Moves the weights to the minimum over the corral's affine hull, as far as they stay positive, dropping what reaches
/// zero until the whole way is free. Returns the size of the corral.
int ExampleWeights::shrink_to_simplex(Workspace& workspace, int count, Eigen::VectorXd& weights) const noexcept {
  auto& [load, affine, slopes, system, corral, state] = workspace;
  for (;;) {
    double length = 1;
    int leaving = -1;
    for (int i = 0; i < count; ++i) {
      const double from = weights[corral[i]];
      if (affine[i] > 0 || from <= affine[i]) continue;
      const double reach = from / (from - affine[i]);
      if (leaving >= 0 && reach >= length) continue;
      length = reach;
      leaving = i;
    }
    for (int i = 0; i < count; ++i) weights[corral[i]] += length * (affine[i] - weights[corral[i]]);
    if (leaving < 0) return count;
    weights[corral[leaving]] = 0;
    state[corral[leaving]] = kOut;
    for (int i = leaving; i + 1 < count; ++i) corral[i] = corral[i + 1];
    --count;
    if (!solve_affine(workspace, count)) return count;
  }
}

/// Minimum over the affine hull of the corral's first `count` examples, in workspace.affine: with the first as origin,
/// Cholesky of the Gram matrix of the differences. False where they are affinely dependent to rounding.
bool ExampleWeights::solve_affine(Workspace& workspace, int count) const noexcept {
  auto& [load, affine, slopes, system, corral, state] = workspace;
  const int origin = corral[0];
  const auto difference_gram = [&](int i, int j) {
    return gram_(i, j) - gram_(i, origin) - gram_(origin, j) + gram_(origin, origin);
  };
  for (int i = 1; i < count; ++i) {
    const int row = corral[i];
    double right = (load[row] - gram_(row, origin)) - (load[origin] - gram_(origin, origin));
    for (int j = 1; j <= i; ++j) {
      double entry = difference_gram(row, corral[j]);
      for (int k = 1; k < j; ++k) entry -= system(i, k) * system(j, k);
      if (j < i) {
        system(i, j) = entry / system(j, j);
        right -= system(i, j) * affine[j];
      } else {
        if (!(entry > kDependent * gram_.diagonal().maxCoeff())) return false;
        system(i, i) = std::sqrt(entry);
      }
    }
    affine[i] = right / system(i, i);
  }
  affine[0] = 1;
  for (int i = count - 1; i > 0; --i) {
    for (int k = i + 1; k < count; ++k) affine[i] -= system(k, i) * affine[k];
    affine[i] /= system(i, i);
    affine[0] -= affine[i];
  }
  return true;
}

void apply_example_bias(double bias, Eigen::VectorXd& weights) noexcept {
  if (weights.size() < 2) return;
  const double shared = (1 - bias) * weights[0] / static_cast<double>(weights.size() - 1);
  weights[0] *= bias;
  auto others = weights.tail(weights.size() - 1).array();
  others = (others + shared).min(1.0);
}

}  // namespace exmat::runtime
