#include "runtime/sim/lanes/lane_examples.h"

#include <gtest/gtest.h>
#include <vector>

#include "tests/support/instruction_sets.h"
#include "tests/support/lanes.h"
#include "tests/support/random.h"

// Weights and targets of bodies side by side, of every instruction set, against those of each body and definitions.

namespace exmat::runtime {
namespace lane_examples_test {

constexpr Eigen::Index kModes = 7;

struct Problem {
  Eigen::MatrixXd examples;  ///< [D x K]
  Eigen::MatrixXd shape;     ///< [D x r], the descriptor of q is shape q

  ExampleWeights solver() const {
    return {RowMatrix(examples.transpose() * examples), Eigen::VectorXd::Zero(examples.cols()),
            RowMatrix(examples.transpose() * shape)};
  }
};

Problem random_problem(Eigen::Index count, std::uint32_t seed) {
  return {test::random_matrix(9, count, seed), test::random_matrix(9, kModes, seed + 1000)};
}

/// Weights by the candidates of every instruction set at the poses in the rows of q: [kLanes x K] each.
std::vector<test::LaneRows> weights_in_lanes(const ExampleWeights& solver, const test::LaneRows& q) {
  const test::LaneRows load =
      (q * solver.load_slope().topRows(solver.examples()).transpose()).rowwise() + solver.load_at_rest().transpose();
  std::vector<test::LaneRows> found;
  for (const Kernels* kernels : available()) {
    AlignedArray weights(solver.examples() * kLanes);
    kernels->lanes_weights(solver.candidates(), test::in_lanes(load).data(), weights.data());
    found.push_back(test::out_of_lanes(weights, solver.examples()));
  }
  return found;
}

// Those of one body beside them, and the optimality conditions: poses far from the hull, near it, on its faces and
// corners.
TEST(LaneExamples, WeightsAreTheNearestPointOfTheHull) {
  int inside = 0, corners = 0;
  for (Eigen::Index count = 1; count <= WeightCandidates::kMostExamples; ++count)
    for (std::uint32_t seed = 0; seed < 40; ++seed) {
      Problem problem = random_problem(count, seed);
      Eigen::VectorXd mixture = test::random_vector(count, seed + 5).cwiseAbs();
      problem.shape.col(0) = problem.examples * (mixture / mixture.sum());
      problem.shape.col(1) = problem.examples.col(count - 1);
      test::LaneRows q = (seed % 2 == 0 ? 0.3 : 3.0) * test::random_matrix(kLanes, kModes, seed + 9);
      q.row(3) = Eigen::RowVectorXd::Unit(kModes, 0);
      q.row(5) = Eigen::RowVectorXd::Unit(kModes, 1);
      const ExampleWeights solver = problem.solver();
      ASSERT_TRUE(solver.has_candidates());
      auto workspace = solver.make_workspace();
      for (const test::LaneRows& found : weights_in_lanes(solver, q))
        for (Eigen::Index lane = 0; lane < kLanes; ++lane) {
          const Eigen::VectorXd own = q.row(lane), weights = found.row(lane);
          Eigen::VectorXd expected(count);
          solver.solve(own, workspace, expected);
          EXPECT_LE((weights - expected).norm(), 1e-12) << count << " examples, seed " << seed << ", lane " << lane;
          EXPECT_NEAR(weights.sum(), 1, 1e-15);
          EXPECT_GE(weights.minCoeff(), 0);
          const Eigen::VectorXd residual = problem.examples * weights - problem.shape * own;
          const Eigen::VectorXd slopes = problem.examples.transpose() * residual;
          EXPECT_GE(slopes.minCoeff(), slopes.dot(weights) - 1e-12 * (1 + slopes.norm()));
          inside += count > 1 && weights.minCoeff() > 0;
          corners += count > 1 && weights.maxCoeff() == 1;
        }
    }
  EXPECT_GT(inside, 100);
  EXPECT_GT(corners, 100);
}

TEST(LaneExamples, AreForFewExamplesThatAreWellApart) {
  EXPECT_TRUE(random_problem(4, 1).solver().has_candidates());
  EXPECT_FALSE(random_problem(5, 1).solver().has_candidates());
  Problem problem = random_problem(4, 1);
  problem.examples.col(3) = 0.5 * (problem.examples.col(1) + problem.examples.col(2));
  EXPECT_FALSE(problem.solver().has_candidates()) << "on a line";
  problem.examples.col(3) = problem.examples.col(0);
  EXPECT_FALSE(problem.solver().has_candidates()) << "repeated";
}

TEST(LaneExamples, BernsteinPolynomialsAreThoseOfEachBody) {
  for (const auto& [degree, count] : {std::pair{1, 2}, {5, 2}, {60, 2}, {8, 3}, {8, 4}, {3, 5}}) {
    const BernsteinBasis basis(degree, count);
    test::LaneRows weights = test::random_matrix(kLanes, count, 3).cwiseAbs();
    for (Eigen::Index lane = 0; lane < kLanes; ++lane) weights.row(lane) /= weights.row(lane).sum();
    weights.row(2) = Eigen::RowVectorXd::Unit(count, 0);
    weights.row(6) = Eigen::RowVectorXd::Unit(count, count - 1);
    weights.row(7) = Eigen::RowVectorXd::Unit(count, 0) * (1 - 1e-9) + Eigen::RowVectorXd::Unit(count, 1) * 1e-9;
    auto workspace = basis.make_workspace();
    for (const Kernels* kernels : available()) {
      AlignedArray scratch(lane_bernstein_scratch(degree, count)), values(basis.size() * kLanes);
      kernels->lanes_bernstein(basis.arrays(), test::in_lanes(weights).data(), scratch.data(), values.data());
      for (Eigen::Index lane = 0; lane < kLanes; ++lane) {
        Eigen::VectorXd expected(basis.size());
        basis.values(weights.row(lane).transpose(), workspace, expected);
        const Eigen::VectorXd found = test::out_of_lanes(values, basis.size()).row(lane);
        for (Eigen::Index n = 0; n < basis.size(); ++n)
          EXPECT_NEAR(found[n], expected[n], 1e-15 * expected[n]) << kernels->name << " D " << degree << " K " << count;
      }
    }
  }
}

}  // namespace lane_examples_test
}  // namespace exmat::runtime
