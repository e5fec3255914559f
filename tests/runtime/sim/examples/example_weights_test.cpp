#include "runtime/sim/examples/example_weights.h"

#include <algorithm>
#include <functional>
#include <gtest/gtest.h>
#include <limits>

#include "tests/support/random.h"

namespace exmat::runtime {
namespace {

/// Examples [D x K] and a current descriptor c = shape [D x r] q.
struct Problem {
  Eigen::MatrixXd examples;
  Eigen::MatrixXd shape;

  ExampleWeights solver() const {
    const RowMatrix gram = examples.transpose() * examples;
    const RowMatrix hq = examples.transpose() * shape;
    return {gram, Eigen::VectorXd::Zero(examples.cols()), hq};
  }
  double distance(const Eigen::VectorXd& weights, const Eigen::VectorXd& q) const {
    return (examples * weights - shape * q).squaredNorm();
  }
};

Problem random_problem(Eigen::Index dimension, Eigen::Index count, std::uint32_t seed) {
  return {test::random_matrix(dimension, count, seed), test::random_matrix(dimension, 5, seed + 1000)};
}

Eigen::VectorXd solve(const Problem& problem, const Eigen::VectorXd& q) {
  const ExampleWeights solver = problem.solver();
  auto workspace = solver.make_workspace();
  Eigen::VectorXd weights(problem.examples.cols());
  solver.solve(q, workspace, weights);
  return weights;
}

/// Feasible, and no example would bring the hull's point nearer.
void expect_optimal(const Problem& problem, const Eigen::VectorXd& q, double tolerance) {
  const Eigen::VectorXd weights = solve(problem, q);
  const Eigen::VectorXd residual = problem.examples * weights - problem.shape * q;
  const Eigen::VectorXd slopes = problem.examples.transpose() * residual;
  const double level = slopes.dot(weights);
  const double scale = problem.examples.squaredNorm() + (problem.shape * q).squaredNorm();
  EXPECT_NEAR(weights.sum(), 1, 1e-13);
  EXPECT_GE(weights.minCoeff(), 0);
  EXPECT_GE(slopes.minCoeff(), level - tolerance * scale);
}

void visit_simplex(Eigen::Index count, int parts, const std::function<void(const Eigen::VectorXd&)>& visit) {
  Eigen::VectorXd weights = Eigen::VectorXd::Zero(count);
  const std::function<void(Eigen::Index, int)> fill = [&](Eigen::Index k, int left) {
    if (k + 1 == count) {
      weights[k] = static_cast<double>(left) / parts;
      visit(weights);
      return;
    }
    for (int share = 0; share <= left; ++share) {
      weights[k] = static_cast<double>(share) / parts;
      fill(k + 1, left - share);
    }
  };
  fill(0, parts);
}

TEST(ExampleWeightsTest, NoPointOfAFineGridOfTheSimplexIsBetter) {
  for (Eigen::Index count = 2; count <= 4; ++count)
    for (std::uint32_t seed = 0; seed < 20; ++seed) {
      const Problem problem = random_problem(6, count, seed);
      const Eigen::VectorXd q = test::random_vector(5, seed + 77);
      const double found = problem.distance(solve(problem, q), q);
      double best = std::numeric_limits<double>::infinity();
      visit_simplex(count, 40, [&](const Eigen::VectorXd& w) { best = std::min(best, problem.distance(w, q)); });
      EXPECT_LE(found, best * (1 + 1e-12));
      // Half a grid step in each weight moves the point by at most this, so that the grid is no further off.
      EXPECT_GE(std::sqrt(found) + problem.examples.norm() * static_cast<double>(count) / 80, std::sqrt(best));
    }
}

TEST(ExampleWeightsTest, OptimalityConditionsHoldForAnyCount) {
  for (Eigen::Index count = 1; count <= 12; ++count)
    for (std::uint32_t seed = 0; seed < 50; ++seed)
      expect_optimal(random_problem(18, count, seed), test::random_vector(5, seed), 1e-13);
}

TEST(ExampleWeightsTest, OptimalWhereExamplesAreAffinelyDependent) {
  for (Eigen::Index dimension = 1; dimension <= 3; ++dimension)
    for (Eigen::Index count = 3; count <= 10; ++count)
      for (std::uint32_t seed = 0; seed < 50; ++seed)
        expect_optimal(random_problem(dimension, count, seed), 0.5 * test::random_vector(5, seed), 1e-12);
}

TEST(ExampleWeightsTest, OptimalWhereExamplesAreRepeatedOrNearlyCollinear) {
  for (std::uint32_t seed = 0; seed < 50; ++seed) {
    Problem problem = random_problem(8, 6, seed);
    problem.examples.col(3) = problem.examples.col(1);
    problem.examples.col(4) = problem.examples.col(0);
    problem.examples.col(5) = 0.5 * (problem.examples.col(1) + problem.examples.col(2));
    problem.examples.col(5)[0] += seed % 2 == 0 ? 1e-9 : 0;
    expect_optimal(problem, test::random_vector(5, seed), 1e-9);
  }
}

TEST(ExampleWeightsTest, AnExampleItselfGivesItTheWholeWeight) {
  for (std::uint32_t seed = 0; seed < 10; ++seed) {
    Problem problem = random_problem(18, 4, seed);
    problem.shape.col(0) = problem.examples.col(2);
    const Eigen::VectorXd weights = solve(problem, Eigen::VectorXd::Unit(5, 0));
    EXPECT_LE((weights - Eigen::VectorXd::Unit(4, 2)).norm(), 1e-12);
  }
}

TEST(ExampleWeightsTest, AMixtureIsFoundAgain) {
  for (std::uint32_t seed = 0; seed < 10; ++seed) {
    Problem problem = random_problem(18, 4, seed);
    const Eigen::VectorXd mixture = Eigen::Vector4d(0.1, 0, 0.6, 0.3);
    problem.shape.col(0) = problem.examples * mixture;
    EXPECT_LE((solve(problem, Eigen::VectorXd::Unit(5, 0)) - mixture).norm(), 1e-12);
  }
}

TEST(ExampleWeightsTest, SmallDifferencesOnALargeRestDescriptorKeepTheirDigits) {
  Problem problem = random_problem(18, 3, 5);
  const Eigen::VectorXd mixture = Eigen::Vector3d(0.2, 0.5, 0.3);
  problem.examples *= 1e-3;
  problem.examples.colwise() += 10 * test::random_vector(18, 6);
  problem.shape.col(0) = problem.examples * mixture;
  EXPECT_LE((solve(problem, Eigen::VectorXd::Unit(5, 0)) - mixture).norm(), 1e-6);
}

TEST(ExampleWeightsTest, SolvesTheSameTwiceAndSurvivesNan) {
  const Problem problem = random_problem(18, 5, 9);
  const Eigen::VectorXd q = test::random_vector(5, 3);
  EXPECT_EQ(solve(problem, q), solve(problem, q));
  solve(problem, Eigen::VectorXd::Constant(5, std::numeric_limits<double>::quiet_NaN()));
}

TEST(ExampleBiasTest, GivesWhatTheRestPoseLosesToTheOthers) {
  Eigen::VectorXd weights = Eigen::Vector3d(0.8, 0.2, 0);
  apply_example_bias(0.25, weights);
  EXPECT_LE((weights - Eigen::Vector3d(0.2, 0.5, 0.3)).norm(), 1e-15);
  apply_example_bias(1, weights);
  EXPECT_LE((weights - Eigen::Vector3d(0.2, 0.5, 0.3)).norm(), 1e-15);
  apply_example_bias(0, weights);
  EXPECT_EQ(weights[0], 0);
  EXPECT_NEAR(weights.sum(), 1, 1e-15);
}

TEST(ExampleBiasTest, LeavesASingleExampleAlone) {
  Eigen::VectorXd weights = Eigen::VectorXd::Ones(1);
  apply_example_bias(0.3, weights);
  EXPECT_EQ(weights[0], 1);
}

}  // namespace
}  // namespace exmat::runtime
