#include "precompute/targets/simplex_points.h"

#include <algorithm>
#include <cmath>
#include <gtest/gtest.h>
#include <numbers>
#include <vector>

#include "runtime/sim/examples/bernstein_basis.h"

namespace exmat::precompute {
namespace {

RowMatrix nodes_of(int degree, int coordinates) {
  return interpolation_nodes(runtime::BernsteinBasis(degree, coordinates).exponents());
}

TEST(InterpolationNodes, LieOnTheSimplexAndAreItsCornersAtTheEnds) {
  for (const int coordinates : {2, 3, 4}) {
    const RowMatrix nodes = nodes_of(7, coordinates);
    EXPECT_GE(nodes.minCoeff(), 0);
    EXPECT_LE((nodes.rowwise().sum().array() - 1).abs().maxCoeff(), 1e-15);
    EXPECT_EQ((nodes.array() == 1.0).count(), coordinates);
  }
}

TEST(InterpolationNodes, AreThoseOfChebyshevAndLobattoOnEdges) {
  for (const int coordinates : {2, 3, 4}) {
    const RowMatrix nodes = nodes_of(9, coordinates);
    std::vector<double> on_edge;
    for (Eigen::Index n = 0; n < nodes.rows(); ++n)
      if (nodes.row(n).tail(coordinates - 2).isZero(0)) on_edge.push_back(nodes(n, 0));
    std::sort(on_edge.begin(), on_edge.end());
    ASSERT_EQ(on_edge.size(), 10U);
    for (std::size_t i = 0; i < 10; ++i)
      EXPECT_NEAR(on_edge[i], 0.5 - 0.5 * std::cos(std::numbers::pi * static_cast<double>(i) / 9), 1e-15);
  }
}

TEST(InterpolationNodes, ArePermutedWithTheCoordinates) {
  const RowMatrix nodes = nodes_of(6, 3);
  const RowMatrix permuted = nodes(Eigen::all, std::vector<int>{2, 0, 1});
  for (Eigen::Index n = 0; n < nodes.rows(); ++n)
    EXPECT_LE((nodes.rowwise() - permuted.row(n)).rowwise().norm().minCoeff(), 1e-15);
}

TEST(SpreadPoints, FillEveryFaceOfTheSimplex) {
  constexpr int kPerDimension = 50;
  const RowMatrix points = spread_points(4, kPerDimension);
  ASSERT_EQ(points.rows(), kPerDimension * (6 * 1 + 4 * 2 + 1 * 3));
  EXPECT_GE(points.minCoeff(), 0);
  EXPECT_LE((points.rowwise().sum().array() - 1).abs().maxCoeff(), 1e-15);
  std::vector<int> of_dimension(4, 0);
  for (Eigen::Index n = 0; n < points.rows(); ++n) ++of_dimension[(points.row(n).array() > 0).count() - 1];
  EXPECT_EQ(of_dimension, (std::vector<int>{0, 6 * 50, 4 * 100, 150}));
  // Uniform: every coordinate has the same mean inside a face.
  EXPECT_LE((points.bottomRows(150).colwise().mean().array() - 0.25).abs().maxCoeff(), 0.02);
}

TEST(SpreadPoints, LeaveNoGapOnAnEdge) {
  const RowMatrix points = spread_points(2, 64);
  std::vector<double> sorted(points.col(0).begin(), points.col(0).end());
  sorted.insert(sorted.end(), {0.0, 1.0});
  std::sort(sorted.begin(), sorted.end());
  for (std::size_t i = 1; i < sorted.size(); ++i) EXPECT_LE(sorted[i] - sorted[i - 1], 3.0 / 64);
}

TEST(SomeTogether, HaveSoManyOfAllCoordinates) {
  const RowMatrix points = some_together(9, 3, 200, 5);
  ASSERT_EQ(points.rows(), 200);
  EXPECT_EQ(points, some_together(9, 3, 200, 5));
  EXPECT_LE((points.rowwise().sum().array() - 1).abs().maxCoeff(), 1e-15);
  for (const auto& row : points.rowwise()) EXPECT_EQ((row.tail(8).array() > 0).count(), 3);
  const auto with_first = (points.col(0).array() > 0).count();
  EXPECT_GT(with_first, 70);  // of 200 halves, four deviations at least
  EXPECT_LT(with_first, 130);
  EXPECT_GT((points.array() > 0).colwise().count().tail(8).minCoeff(), 40);  // of 75 each
}

}  // namespace
}  // namespace exmat::precompute
