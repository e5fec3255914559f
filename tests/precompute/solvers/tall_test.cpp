#include "precompute/solvers/tall.h"

#include <gtest/gtest.h>
#include <omp.h>

#include "tests/support/random.h"

// Against Eigen's products, of enough rows for several threads and of few.

namespace exmat::precompute {
namespace tall_test {

constexpr double kTolerance = 1e-13;

class Tall : public testing::TestWithParam<Eigen::Index> {
 protected:
  Eigen::Index rows() const { return GetParam(); }
  RowMatrix matrix(Eigen::Index columns, unsigned seed) const { return test::random_matrix(rows(), columns, seed); }
};

INSTANTIATE_TEST_SUITE_P(Rows, Tall, testing::Values(1, 77, 20'003));

// Products with every number of columns that the sums are cut into.
TEST_P(Tall, ProductsAreThoseOfEigen) {
  std::vector<Eigen::Triplet<double>> entries;
  const Eigen::VectorXd values = test::random_vector(5 * rows(), 3);
  for (Eigen::Index i = 0; i < 5 * rows(); ++i)
    if (i / 5 % 7 != 3) entries.emplace_back(i / 5, (i * 7919) % rows(), values[i]);
  SparseMatrix A(rows(), rows());
  A.setFromTriplets(entries.begin(), entries.end());
  RowMatrix Y;
  for (const Eigen::Index columns : {1, 7, 16, 24, 41}) {
    const RowMatrix X = matrix(columns, 4), expected = A * X;
    product(A, X, Y);
    EXPECT_LE((Y - expected).norm(), kTolerance * expected.norm()) << columns;
    EXPECT_EQ(product(A, X), Y);
  }
}

TEST_P(Tall, SumsOfColumnsAreThoseOfEigen) {
  const RowMatrix V = matrix(18, 1), B = matrix(18, 2);
  const Eigen::RowVectorXd a = test::random_vector(18, 3).transpose(), b = test::random_vector(18, 4).transpose();
  RowMatrix X = B;
  combine(a, b, V, X);
  const RowMatrix expected = B * a.asDiagonal() + V * b.asDiagonal();
  EXPECT_LE((X - expected).norm(), kTolerance * expected.norm());
  EXPECT_LE((column_dots(V, B) - V.cwiseProduct(B).colwise().sum()).norm(), kTolerance * V.norm() * B.norm());
  EXPECT_LE((inner(V, B) - V.transpose() * B).norm(), kTolerance * V.norm() * B.norm());
}

TEST_P(Tall, TurnsRowsAndColumnsAround) {
  const Eigen::MatrixXd columns = test::random_matrix(rows(), 9, 1);
  const RowMatrix rows_of_it = by_rows(columns.middleCols(2, 6));
  EXPECT_EQ(rows_of_it, columns.middleCols(2, 6));
  Eigen::MatrixXd back = Eigen::MatrixXd::Zero(rows(), 9);
  put_by_columns(rows_of_it, back.middleCols(2, 6));
  EXPECT_EQ(back.middleCols(2, 6), columns.middleCols(2, 6));
  EXPECT_EQ(back.leftCols(2).norm() + back.rightCols(1).norm(), 0);
}

TEST_P(Tall, AreTheSameForEveryNumberOfThreads) {
  const RowMatrix V = matrix(18, 1), B = matrix(18, 2);
  const auto results = [&](int threads) {
    omp_set_num_threads(threads);
    RowMatrix X = B;
    add_product(-1, V, inner(V, B), X);
    combine(column_dots(V, B), column_dots(V, V), V, X);
    return X;
  };
  const int before = omp_get_max_threads();
  const RowMatrix one = results(1), three = results(3);
  omp_set_num_threads(before);
  EXPECT_EQ(one, three);
}

}  // namespace tall_test
}  // namespace exmat::precompute
