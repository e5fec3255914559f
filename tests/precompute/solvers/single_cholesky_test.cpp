#include "precompute/solvers/single_cholesky.h"

#include <Eigen/SparseCholesky>
#include <algorithm>
#include <gtest/gtest.h>
#include <numeric>
#include <omp.h>

#include "common/core/decompositions.h"
#include "precompute/fem/elastic_system.h"
#include "precompute/solvers/dissection.h"
#include "tests/support/box_mesh.h"
#include "tests/support/random.h"

namespace exmat::precompute {
namespace single_cholesky_test {

// Condition number times the rounding of single precision.
constexpr double kTolerance = 2e-5;

SparseMatrix random_definite(Eigen::Index n, double least, unsigned seed) {
  Eigen::MatrixXd A = test::random_matrix(n, n, seed);
  A = (A.array().abs() > least).select(A, 0);
  A = (A + A.transpose()).eval();
  A.diagonal().array() = 1 + A.cwiseAbs().rowwise().sum().maxCoeff();
  return A.sparseView();
}

SparseMatrix clamped_stiffness(const std::array<int, 3>& cells) {
  const TetMesh mesh = test::box_mesh(cells, {1.0, 0.8, 0.6});
  const Eigen::VectorXd ones = Eigen::VectorXd::Ones(mesh.tet_count());
  const FlagVector fixed = (mesh.vertices.col(0).array() < 1e-9).cast<std::uint8_t>();
  return build_elastic_system(mesh, {ones, ones, 0.3 * ones}, fixed).stiffness;
}

RowMatrix solved(const SparseMatrix& matrix, int block, const std::vector<Eigen::Index>& left_out, const RowMatrix& B) {
  SingleCholesky factors(dissected_elimination(graph_of(matrix, block), block), block);
  EXPECT_TRUE(factors.factorise(matrix, left_out));
  RowMatrix X;
  factors.solve(B, X);
  return X;
}

// Against dense factors in double of what is not left out.
void expect_solved(const SparseMatrix& matrix, int block, const std::vector<Eigen::Index>& left_out) {
  const RowMatrix B = test::random_matrix(matrix.rows(), 5, 3), X = solved(matrix, block, left_out, B);
  std::vector<Eigen::Index> kept;
  for (Eigen::Index i = 0; i < matrix.rows(); ++i)
    if (!std::ranges::binary_search(left_out, i)) kept.push_back(i);
  const Eigen::MatrixXd whole = matrix, part = whole(kept, kept), loads = B(kept, Eigen::all),
                        answer = part.llt().solve(loads);
  Eigen::MatrixXd expected = Eigen::MatrixXd::Zero(B.rows(), B.cols());
  expected(kept, Eigen::all) = answer;
  EXPECT_LE((X - expected).norm(), kTolerance * expected.norm());
}

TEST(SingleCholesky, SolvesAsDenseFactorsDoForRandomPatterns) {
  for (unsigned seed = 0; seed < 30; ++seed)
    expect_solved(random_definite(1 + 3 * seed, 0.6 + 0.4 * (seed % 5) / 5, seed), 1, {});
}

TEST(SingleCholesky, SolvesForDisplacementsOfAMesh) {
  const SparseMatrix matrix = clamped_stiffness({7, 6, 5});
  expect_solved(matrix, 3, {});
  expect_solved(matrix, 1, {});
  expect_solved(matrix, 3, {0, 7, 8, 100, matrix.rows() - 1});
}

// Fronts that several threads share, and right-hand sides of any number.
TEST(SingleCholesky, GivesTheSameBitsForEveryNumberOfThreads) {
  const SparseMatrix matrix = clamped_stiffness({12, 12, 12});
  const int before = omp_get_max_threads();
  for (const Eigen::Index columns : {1, 5, 40, 70}) {
    const RowMatrix B = test::random_matrix(matrix.rows(), columns, 4);
    omp_set_num_threads(1);
    const RowMatrix alone = solved(matrix, 3, {}, B);
    omp_set_num_threads(3);
    EXPECT_EQ(solved(matrix, 3, {}, B), alone);
  }
  omp_set_num_threads(before);
}

TEST(SingleCholesky, SeesMatricesThatAreNotPositiveDefinite) {
  Eigen::MatrixXd A = Eigen::MatrixXd::Identity(6, 6) * 2;
  A(4, 1) = A(1, 4) = 3;
  const SparseMatrix matrix = A.sparseView();
  SingleCholesky factors(dissected_elimination(graph_of(matrix, 1), 1), 1);
  EXPECT_FALSE(factors.factorise(matrix, {}));
}

// As many right-hand sides as go through the factors together, and more; into their own place.
TEST(SingleCholesky, SolvesForManyRightHandSides) {
  const SparseMatrix matrix = clamped_stiffness({9, 8, 7});
  SingleCholesky factors(dissected_elimination(graph_of(matrix, 3), 3), 3);
  ASSERT_TRUE(factors.factorise(matrix, {}));
  const Eigen::SimplicialLLT<Eigen::SparseMatrix<double>> exact(Eigen::SparseMatrix<double>{matrix});
  for (const Eigen::Index columns : {64, 65, 130}) {
    const RowMatrix B = test::random_matrix(matrix.rows(), columns, 6);
    const RowMatrix expected = exact.solve(Eigen::MatrixXd(B));
    RowMatrix X = B;
    factors.solve(X, X);
    for (Eigen::Index k = 0; k < columns; ++k)
      EXPECT_LE((X.col(k) - expected.col(k)).norm(), kTolerance * expected.col(k).norm()) << k;
  }
}

// Every entry that elimination by the book fills is in a node, for any order.
TEST(Elimination, HoldsAllFill) {
  for (unsigned seed = 0; seed < 20; ++seed) {
    const Eigen::Index n = 2 + 2 * seed;
    const SparseMatrix matrix = random_definite(n, 0.85, seed);
    const Elimination plan = elimination_of(graph_of(matrix, 1), nested_dissection(graph_of(matrix, 1)), 1);
    Eigen::MatrixXi filled = Eigen::MatrixXi::Zero(n, n), held = filled;
    for (Eigen::Index i = 0; i < n; ++i)
      for (SparseMatrix::InnerIterator entry(matrix, i); entry; ++entry)
        filled(plan.place[static_cast<std::size_t>(i)], plan.place[static_cast<std::size_t>(entry.col())]) = 1;
    for (Eigen::Index k = 0; k < n; ++k)
      for (Eigen::Index i = k + 1; i < n; ++i)
        for (Eigen::Index j = k + 1; j < n; ++j) filled(i, j) |= filled(i, k) & filled(k, j);
    for (const Elimination::Node& node : plan.nodes)
      for (std::int32_t c = node.begin; c < node.begin + node.columns; ++c) {
        held.col(c).segment(node.begin, node.columns).setOnes();
        for (const std::int32_t row : node.rows) held(row, c) = 1;
      }
    Eigen::Index entries = 0;
    for (Eigen::Index c = 0; c < n; ++c) {
      entries += filled.col(c).tail(n - c).sum();
      for (Eigen::Index row = c; row < n; ++row) EXPECT_LE(filled(row, c), held(row, c));
    }
    EXPECT_GE(plan.entries(), entries);
  }
}

// A grid of n^2 vertices fills n^3 entries row by row, and O(n^2 log n) by dissection (George 1973).
TEST(NestedDissection, FillsLittle) {
  const auto entries = [](const Graph& graph, bool dissected) {
    std::vector<std::int32_t> place(static_cast<std::size_t>(graph.size()));
    std::iota(place.begin(), place.end(), 0);
    return elimination_of(graph, dissected ? nested_dissection(graph) : place, 3).entries();
  };
  const Graph plate = graph_of(clamped_stiffness({60, 60, 1}), 3);
  std::vector<std::int32_t> place = nested_dissection(plate);
  std::ranges::sort(place);
  for (std::int32_t i = 0; i < plate.size(); ++i) EXPECT_EQ(place[static_cast<std::size_t>(i)], i);
  EXPECT_EQ(nested_dissection(plate), nested_dissection(plate));
  EXPECT_LT(2 * entries(plate, true), entries(plate, false));
}

}  // namespace single_cholesky_test
}  // namespace exmat::precompute
