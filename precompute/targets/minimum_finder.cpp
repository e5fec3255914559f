#include "precompute/targets/minimum_finder.h"

#include <algorithm>
#include <limits>

#include "common/core/progress.h"

namespace exmat::precompute {
namespace {

constexpr double kResidual = 0.1;             // of the distance of answers that are one minimum
constexpr Eigen::Index kSolvedTogether = 64;  // weights whose minima of all tets are found side by side

}  // namespace

// Each of `candidates` to a minimum.
void MinimumFinder::descend(const RowMatrix& weights, std::vector<Candidate>& candidates) const {
  const double enough = kResidual * same_distance_;
#pragma omp parallel
  {
    auto workspace = target_.make_workspace();
#pragma omp for schedule(dynamic)
    for (std::size_t i = 0; i < candidates.size(); ++i) {
      Candidate& candidate = candidates[i];
      if (all_ != nullptr && near_) continue;
      const auto report = target_.solve(weights.row(candidate.row).transpose(), workspace, candidate.y);
      candidate.found = report.status == runtime::NewtonStatus::kConverged || report.residual <= enough;
    }
  }
  if (all_ == nullptr) return;
  std::erase_if(candidates, [](const Candidate& candidate) { return !candidate.found; });
  RowMatrix at(std::ssize(candidates), weights.cols());
  Eigen::MatrixXd y(target_.dimension(), at.rows());
  for (Eigen::Index i = 0; i < at.rows(); ++i) {
    at.row(i) = weights.row(candidates[static_cast<std::size_t>(i)].row);
    y.col(i) = candidates[static_cast<std::size_t>(i)].y;
  }
  const std::vector<ElementForces::Answer> answers = all_->polish(target_, at, y);
  for (std::size_t i = 0; i < candidates.size(); ++i) {
    candidates[i].y = y.col(static_cast<Eigen::Index>(i));
    candidates[i].found = answers[i].converged || answers[i].residual <= enough;
  }
}

// Takes minima of the same weights into account.
void MinimumFinder::add(const RowMatrix& weights, std::vector<Candidate> candidates,
                        std::vector<Minimum>& minima) const {
  descend(weights, candidates);
  auto workspace = target_.make_workspace();
  for (const Candidate& candidate : candidates) {
    if (!candidate.found) continue;
    Minimum& lowest = minima[static_cast<std::size_t>(candidate.row)];
    const auto energy = [&](const Eigen::VectorXd& y) {
      return target_.energy(weights.row(candidate.row).transpose(), y, workspace);
    };
    const bool same = lowest.found && (candidate.y - lowest.y).norm() <= same_distance_;
    lowest.only = lowest.only && (same || !lowest.found);
    if (!lowest.found || (!same && energy(candidate.y) < energy(lowest.y))) lowest.y = candidate.y;
    lowest.found = true;
  }
}

// Lowest minima for some weights, from their starts; where none leads to a minimum, from the blend.
std::vector<MinimumFinder::Minimum> MinimumFinder::lowest(
    const RowMatrix& weights, const std::vector<std::vector<Eigen::VectorXd>>& starts) const {
  const Eigen::VectorXd none = Eigen::VectorXd::Constant(target_.dimension(), std::numeric_limits<double>::quiet_NaN());
  std::vector<Minimum> minima(starts.size(), Minimum{none});
  std::vector<Candidate> candidates;
  for (std::size_t i = 0; i < starts.size(); ++i)
    for (const Eigen::VectorXd& y : starts[i]) candidates.push_back({static_cast<Eigen::Index>(i), y});
  add(weights, std::move(candidates), minima);
  candidates.clear();
  for (Eigen::Index i = 0; i < weights.rows(); ++i)
    if (!minima[static_cast<std::size_t>(i)].found)
      candidates.push_back({i, blend(target_, weights.row(i).transpose())});
  if (!candidates.empty()) add(weights, std::move(candidates), minima);
  return minima;
}

RowMatrix MinimumFinder::find(const RowMatrix& weights, const Starts& starts, const std::string& stage) {
  RowMatrix found(weights.rows(), target_.dimension());
  Progress progress(stage, weights.rows());
  for (Eigen::Index begin = 0; begin < weights.rows(); begin += kSolvedTogether) {
    const RowMatrix some = weights.middleRows(begin, std::min(kSolvedTogether, weights.rows() - begin));
    std::vector<std::vector<Eigen::VectorXd>> from;
    for (Eigen::Index i = 0; i < some.rows(); ++i) from.push_back(starts(some.row(i).transpose(), begin + i));
    const std::vector<Minimum> minima = lowest(some, from);
    for (std::size_t i = 0; i < minima.size(); ++i) {
      const auto row = static_cast<Eigen::Index>(i);
      found.row(begin + row) = minima[i].y.transpose();
      if (correction_) found.row(begin + row) += correction_(some.row(row).transpose()).transpose();
      solves_ += static_cast<int>(from[i].size());
      ambiguous_ += minima[i].only ? 0 : 1;
    }
    progress.advance(some.rows());
  }
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
