#include "precompute/cubature/selection.h"

#include <algorithm>
#include <cmath>
#include <gtest/gtest.h>
#include <random>

#include "common/core/decompositions.h"

namespace exmat::precompute {
namespace {

// Non-negative columns with a planted sparse solution.
SelectionProblem planted(const std::vector<Eigen::Index>& members, Eigen::Index rows, Eigen::Index candidates,
                         unsigned seed) {
  std::mt19937 generator(seed);
  std::normal_distribution<double> normal;
  SelectionProblem problem;
  problem.columns = Eigen::MatrixXd::NullaryExpr(rows, candidates, [&] { return normal(generator); });
  problem.target = Eigen::VectorXd::Zero(rows);
  for (std::size_t k = 0; k < members.size(); ++k)
    problem.target += (1.0 + static_cast<double>(k)) * problem.columns.col(members[k]);
  return problem;
}

// Columns share a mean, as element responses do, and the target is the sum of all.
SelectionProblem correlated(Eigen::Index rows, Eigen::Index candidates, unsigned seed) {
  std::mt19937 generator(seed);
  std::normal_distribution<double> normal;
  SelectionProblem problem;
  problem.columns = Eigen::MatrixXd::NullaryExpr(rows, candidates, [&] { return 0.3 + normal(generator); });
  problem.target = problem.columns.rowwise().sum();
  return problem;
}

double residual(const SelectionProblem& problem, const Selection& selection) {
  const Eigen::MatrixXd chosen = problem.columns(Eigen::all, selection.members);
  return (chosen * selection.weights - problem.target).norm() / problem.target.norm();
}

void expect_sound(const SelectionProblem& problem, const Selection& selection, std::size_t count) {
  EXPECT_LE(selection.members.size(), count);
  EXPECT_TRUE(std::is_sorted(selection.members.begin(), selection.members.end()));
  EXPECT_EQ(std::adjacent_find(selection.members.begin(), selection.members.end()), selection.members.end());
  EXPECT_GT(selection.weights.minCoeff(), 0);
  // Through the normal equations: half the digits.
  EXPECT_NEAR(selection.relative_residual, residual(problem, selection), 1e-7);
  // Optimal on the support: no gradient along its members.
  const Eigen::MatrixXd chosen = problem.columns(Eigen::all, selection.members);
  const Eigen::VectorXd gradient = chosen.transpose() * (chosen * selection.weights - problem.target);
  EXPECT_LE(gradient.cwiseAbs().maxCoeff(), 1e-9 * chosen.norm() * problem.target.norm());
}

// Best non-negative pair by trying all of them.
double best_pair_residual(const SelectionProblem& problem) {
  double best = 1;
  for (Eigen::Index a = 0; a < problem.columns.cols(); ++a)
    for (Eigen::Index b = a + 1; b < problem.columns.cols(); ++b) {
      const std::vector<Eigen::Index> pair{a, b};
      const Eigen::MatrixXd columns = problem.columns(Eigen::all, pair);
      const Eigen::VectorXd weights = columns.colPivHouseholderQr().solve(problem.target);
      if (weights.minCoeff() < 0) continue;
      best = std::min(best, (columns * weights - problem.target).norm() / problem.target.norm());
    }
  return best;
}

TEST(Selection, EveryMethodFindsAPlantedSolution) {
  const std::vector<Eigen::Index> members{3, 11, 17, 40, 59};
  const auto problem = planted(members, 120, 80, 1);
  for (const auto& selection : {select_greedy_swap(problem, 5, {}, nullptr), select_hard_thresholding(problem, 5)}) {
    EXPECT_EQ(selection.members, members);
    EXPECT_LE((selection.weights - Eigen::VectorXd::LinSpaced(5, 1, 5)).norm(), 1e-10);
    expect_sound(problem, selection, 5);
  }
  // 100 draws with replacement see each of 80 columns with probability 0.72: it needs more members.
  const auto random = select_greedy_random(problem, 12, {}, nullptr, 1);
  EXPECT_LE(random.relative_residual, 1e-6);
}

TEST(Selection, SwapsReachTheBestPairOfSmallProblems) {
  int optimal = 0;
  for (unsigned seed = 0; seed < 20; ++seed) {
    const auto problem = correlated(12, 10, seed);
    const auto selection = select_greedy_swap(problem, 2, {}, nullptr);
    expect_sound(problem, selection, 2);
    const double best = best_pair_residual(problem);
    EXPECT_GE(selection.relative_residual, best - 1e-9);
    EXPECT_LE(selection.relative_residual, 1.2 * best);  // a local search: never far, usually there
    if (selection.relative_residual <= best + 1e-9) ++optimal;
  }
  EXPECT_GE(optimal, 14);
}

TEST(Selection, WeightsStayNonNegativeAndResidualsFallWithTheCount) {
  const auto problem = correlated(90, 150, 5);
  double last = 1;
  for (const std::size_t count : {5U, 10U, 20U, 40U}) {
    const auto swap = select_greedy_swap(problem, count, {}, nullptr);
    expect_sound(problem, swap, count);
    expect_sound(problem, select_greedy_random(problem, count, {}, nullptr, 3), count);
    expect_sound(problem, select_hard_thresholding(problem, count), count);
    EXPECT_EQ(swap.members.size(), count);
    EXPECT_LT(swap.relative_residual, last);
    last = swap.relative_residual;
  }
}

TEST(Selection, ZeroColumnsAreNeverChosen) {
  auto problem = correlated(40, 30, 6);
  problem.columns.leftCols(10).setZero();
  for (const auto& selection :
       {select_greedy_swap(problem, 15, {}, nullptr), select_greedy_random(problem, 15, {}, nullptr, 1),
        select_hard_thresholding(problem, 15)})
    EXPECT_GE(selection.members.front(), 10);
}

TEST(Selection, StopRuleEndsTheSearch) {
  const auto problem = correlated(90, 150, 7);
  const StopRule rule{5, [](const Selection& selection) { return selection.relative_residual < 0.5; }};
  const auto selection = select_greedy_swap(problem, 100, {}, &rule);
  EXPECT_LT(selection.relative_residual, 0.5);
  EXPECT_EQ(selection.members.size() % 5, 0U);
  EXPECT_LT(selection.members.size(), 100U);
}

TEST(Selection, KeepsAnEarlierPass) {
  const auto problem = correlated(60, 80, 8);
  const auto first = select_greedy_random(problem, 8, {}, nullptr, 2);
  const auto second = select_greedy_random(problem, 16, first.members, nullptr, 2);
  EXPECT_LT(second.relative_residual, first.relative_residual);
  expect_sound(problem, second, 16);
}

}  // namespace
}  // namespace exmat::precompute
