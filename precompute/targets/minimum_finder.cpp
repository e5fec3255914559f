#include "precompute/targets/minimum_finder.h"

#include <algorithm>
#include <limits>

#include "common/core/progress.h"

namespace exmat::precompute {
namespace {

constexpr double kResidual = 0.1;  // of the distance of answers that are one minimum

}  // namespace

// Whether `y` became a minimum.
bool MinimumFinder::descend(const Eigen::VectorXd& weights, runtime::TargetSolver::Workspace& workspace,
                            Eigen::VectorXd& y) const {
  const double enough = kResidual * same_distance_;
  if (all_ == nullptr || !near_) {
    const auto report = target_.solve(weights, workspace, y);
    if (report.status != runtime::NewtonStatus::kConverged && !(report.residual <= enough)) return false;
  }
  if (all_ == nullptr) return true;
  const auto answer = all_->polish(target_, weights, workspace, y);
  return answer.converged || answer.residual <= enough;
}

MinimumFinder::Minimum MinimumFinder::lowest(const Eigen::VectorXd& weights, const std::vector<Eigen::VectorXd>& starts,
                                             runtime::TargetSolver::Workspace& workspace) const {
  Minimum lowest{Eigen::VectorXd::Constant(target_.dimension(), std::numeric_limits<double>::quiet_NaN())};
  bool found = false;
  const auto try_from = [&](Eigen::VectorXd y) {
    if (!descend(weights, workspace, y)) return;
    const bool same = found && (y - lowest.y).norm() <= same_distance_;
    lowest.only = lowest.only && (same || !found);
    if (!found || (!same && target_.energy(weights, y, workspace) < target_.energy(weights, lowest.y, workspace)))
      lowest.y = y;
    found = true;
  };
  std::ranges::for_each(starts, try_from);
  if (!found) try_from(blend(target_, weights));
  return lowest;
}

RowMatrix MinimumFinder::find(const RowMatrix& weights, const Starts& starts, const std::string& stage) {
  RowMatrix found(weights.rows(), target_.dimension());
  Progress progress(stage, weights.rows());
  int solves = 0, ambiguous = 0;
#pragma omp parallel reduction(+ : solves, ambiguous)
  {
    auto workspace = target_.make_workspace();
#pragma omp for schedule(dynamic)
    for (Eigen::Index i = 0; i < weights.rows(); ++i) {
      const Eigen::VectorXd w = weights.row(i).transpose();
      const auto from = starts(w, i);
      const Minimum minimum = lowest(w, from, workspace);
      found.row(i) = minimum.y.transpose();
      if (correction_) found.row(i) += correction_(w).transpose();
      solves += static_cast<int>(from.size());
      ambiguous += minimum.only ? 0 : 1;
#pragma omp critical(target_minima_progress)
      progress.advance();
    }
  }
  solves_ += solves;
  ambiguous_ += ambiguous;
  return found;
}

Eigen::VectorXd blend(const runtime::TargetSolver& target, const Eigen::VectorXd& weights) {
  Eigen::VectorXd y(target.dimension());
  target.start(weights, y);
  return y;
}

MinimumFinder::Starts from_blend(const runtime::TargetSolver& target) {
  return [&target](const Eigen::VectorXd& weights, Eigen::Index) {
    return std::vector<Eigen::VectorXd>{blend(target, weights)};
  };
}

std::vector<Eigen::VectorXd> blend_and_examples(const runtime::TargetSolver& target, const Eigen::VectorXd& weights) {
  std::vector<Eigen::VectorXd> all{blend(target, weights)};
  for (Eigen::Index k = 0; k < weights.size(); ++k)
    if (weights[k] > 0) all.push_back(target.example(k));
  return all;
}

}  // namespace exmat::precompute
