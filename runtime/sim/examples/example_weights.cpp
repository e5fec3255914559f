#include "runtime/sim/examples/example_weights.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

#include "common/core/decompositions.h"

namespace exmat::runtime {
namespace {

enum ExampleState : int { kOut, kIn, kRefused };

constexpr double kWeightRounding = 64 * std::numeric_limits<double>::epsilon();
constexpr double kDependent = 1e-14;  // squared distance from the corral's affine hull, relative
constexpr double kWellApart = 1e-6;   // least over largest squared extent of the examples' simplex, for candidates

bool is_member(unsigned members, Eigen::Index k) { return (members >> k & 1U) != 0; }

}  // namespace

ExampleWeights::ExampleWeights(const RowMatrix& gram, const Eigen::VectorXd& h0, const RowMatrix& hq) {
  const Eigen::Index count = gram.rows();
  const Eigen::VectorXd first = gram.col(0);
  gram_ = gram - first * Eigen::RowVectorXd::Ones(count) - Eigen::VectorXd::Ones(count) * gram.row(0) +
          Eigen::MatrixXd::Constant(count, count, gram(0, 0));
  h0_ = (h0.array() - h0[0]).matrix() - (first.array() - gram(0, 0)).matrix();
  slope_.setZero(padded(count), hq.cols());
  slope_.topRows(count) = hq.rowwise() - hq.row(0);
  build_candidates();
}

void ExampleWeights::build_candidates() {
  if (examples() > WeightCandidates::kMostExamples) return;
  if (examples() > 1) {
    const Eigen::MatrixXd differences = gram_.bottomRightCorner(examples() - 1, examples() - 1);
    const Eigen::VectorXd extents = Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(differences).eigenvalues();
    if (!(extents[0] > kWellApart * extents[examples() - 2])) return;
  }
  std::vector<unsigned> sets;
  for (unsigned members = 1; members < 1U << examples(); ++members) sets.push_back(members);
  std::ranges::stable_sort(sets, {}, [](unsigned members) { return std::popcount(members); });
  candidate_count_ = static_cast<Eigen::Index>(sets.size());
  candidate_numbers_ = AlignedArray(examples() * examples() * padded(candidate_count_));
  candidate_members_ = AlignedArray(examples() * padded(candidate_count_));
  for (Eigen::Index n = 0; n < candidate_count_; ++n) set_candidate(n, sets[static_cast<std::size_t>(n)]);
}

/// Affine functions of the load as rows of K + 1 numbers, the last one constant.
void ExampleWeights::set_candidate(Eigen::Index n, unsigned members) {
  const Eigen::Index count = examples(), stride = padded(candidate_count_), size = std::popcount(members) - 1;
  const auto origin = static_cast<Eigen::Index>(std::countr_zero(members));
  const auto load_difference = [&](Eigen::Index k) {
    return Eigen::RowVectorXd(Eigen::RowVectorXd::Unit(count + 1, k) - Eigen::RowVectorXd::Unit(count + 1, origin));
  };
  std::vector<Eigen::Index> others;
  for (Eigen::Index k = origin + 1; k < count; ++k)
    if (is_member(members, k)) others.push_back(k);
  Eigen::MatrixXd values = Eigen::MatrixXd::Zero(count, count + 1);
  values(origin, count) = 1;
  if (size > 0) {
    Eigen::MatrixXd system(size, size), right(size, count + 1);
    for (Eigen::Index i = 0; i < size; ++i) {
      const Eigen::Index row = others[static_cast<std::size_t>(i)];
      right.row(i) = load_difference(row);
      right(i, count) -= gram_(row, origin) - gram_(origin, origin);
      for (Eigen::Index j = 0; j < size; ++j) {
        const Eigen::Index column = others[static_cast<std::size_t>(j)];
        system(i, j) = gram_(row, column) - gram_(row, origin) - gram_(origin, column) + gram_(origin, origin);
      }
    }
    const Eigen::MatrixXd solved = system.llt().solve(right);
    for (Eigen::Index i = 0; i < size; ++i) values.row(others[static_cast<std::size_t>(i)]) = solved.row(i);
    values.row(origin) -= solved.colwise().sum();
  }
  const Eigen::MatrixXd weights = values;
  const double scale = std::max(gram_.diagonal().maxCoeff(), std::numeric_limits<double>::min());
  for (Eigen::Index k = 0; k < count; ++k) {
    candidate_members_[k * stride + n] = is_member(members, k) ? 1 : 0;
    if (!is_member(members, k))
      values.row(k) = ((gram_.row(k) - gram_.row(origin)) * weights - load_difference(k)) / scale;
    candidate_numbers_[k * count * stride + n] = values(k, count);
    for (Eigen::Index j = 1; j < count; ++j) candidate_numbers_[(k * count + j) * stride + n] = values(k, j);
  }
}

ExampleWeights::Workspace ExampleWeights::make_workspace() const {
  const Eigen::Index count = examples();
  return {Eigen::VectorXd::Zero(padded(count)), Eigen::VectorXd::Zero(count), Eigen::VectorXd::Zero(count),
          Eigen::MatrixXd::Zero(count, count),  Eigen::VectorXd::Zero(count), 0,
          Eigen::VectorXi::Zero(count),         Eigen::VectorXi::Zero(count)};
}

void ExampleWeights::solve(const Eigen::VectorXd& q, Workspace& workspace, Eigen::VectorXd& weights) const noexcept {
  kernels().matrix_vector(slope_.data(), slope_.rows(), slope_.cols(), slope_.outerStride(), q.data(),
                          workspace.load.data());
  workspace.load.head(examples()) += h0_;
  if (has_candidates())
    kernels().choose_weights(candidates(), workspace.load.data(), weights.data());
  else
    solve_by_sets(workspace, weights);
}

void ExampleWeights::solve_by_sets(Workspace& workspace, Eigen::VectorXd& weights) const noexcept {
  auto& [padded_load, affine, slopes, system, forward, factored, corral, state] = workspace;
  const auto load = padded_load.head(examples());
  Eigen::Index start = 0;
  (0.5 * gram_.diagonal() - load).minCoeff(&start);
  weights.setZero();
  weights[start] = 1;
  state.setConstant(kOut);
  state[start] = kIn;
  corral[0] = static_cast<int>(start);
  int count = 1;
  factored = 0;

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
  auto& [load, affine, slopes, system, forward, factored, corral, state] = workspace;
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
    factored = std::min(factored, leaving);
    if (!solve_affine(workspace, count)) return count;
  }
}

/// Minimum over the affine hull of the corral's first `count` examples, in workspace.affine: with the first as origin,
/// Cholesky of the Gram matrix of the differences, which is made as far as it is not there yet.
/// False where they are affinely dependent to rounding.
bool ExampleWeights::solve_affine(Workspace& workspace, int count) const noexcept {
  auto& [load, affine, slopes, system, forward, factored, corral, state] = workspace;
  const int origin = corral[0];
  const auto difference_gram = [&](int i, int j) {
    return gram_(i, j) - gram_(i, origin) - gram_(origin, j) + gram_(origin, origin);
  };
  factored = std::max(factored, 1);
  for (int i = factored; i < count; ++i) {
    const int row = corral[i];
    double right = (load[row] - gram_(row, origin)) - (load[origin] - gram_(origin, origin));
    for (int j = 1; j <= i; ++j) {
      double entry = difference_gram(row, corral[j]);
      for (int k = 1; k < j; ++k) entry -= system(i, k) * system(j, k);
      if (j < i) {
        system(i, j) = entry / system(j, j);
        right -= system(i, j) * forward[j];
      } else {
        if (!(entry > kDependent * gram_.diagonal().maxCoeff())) return false;
        system(i, i) = std::sqrt(entry);
      }
    }
    forward[i] = right / system(i, i);
    factored = i + 1;
  }
  affine[0] = 1;
  for (int i = count - 1; i > 0; --i) {
    affine[i] = forward[i];
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
