#include "precompute/full_space/supernodal_cholesky.h"

#include <gtest/gtest.h>

#include "common/core/decompositions.h"
#include "precompute/fem/elastic_system.h"
#include "tests/support/box_mesh.h"
#include "tests/support/random.h"

namespace exmat::precompute {
namespace {

using Matrix = SupernodalCholesky::Matrix;

Matrix lower(const Eigen::MatrixXd& matrix) {
  return Matrix(Eigen::MatrixXd(matrix.triangularView<Eigen::Lower>()).sparseView());
}

void expect_solved(const Matrix& matrix) {
  SupernodalCholesky factors(matrix);
  ASSERT_TRUE(factors.factorise(matrix));
  const Eigen::MatrixXd whole = Matrix(matrix.selfadjointView<Eigen::Lower>());
  const Eigen::VectorXd b = test::random_vector(matrix.rows(), 3), expected = whole.llt().solve(b);
  // Condition number times rounding.
  EXPECT_LE((factors.solve(b) - expected).norm(), 1e-9 * expected.norm());
  EXPECT_GE(factors.entries(), matrix.nonZeros());
}

TEST(SupernodalCholesky, SolvesAsDenseFactorsDoForRandomPatterns) {
  for (unsigned seed = 0; seed < 30; ++seed) {
    const Eigen::Index n = 1 + 3 * seed;
    Eigen::MatrixXd A = test::random_matrix(n, n, seed);
    const double least = 0.6 + 0.4 * (seed % 5) / 5;  // from dense to a few entries a row
    A = (A.array().abs() > least).select(A, 0);
    A = (A + A.transpose()).eval();
    A.diagonal().array() = 1 + A.cwiseAbs().rowwise().sum().maxCoeff();
    expect_solved(lower(A));
  }
}

TEST(SupernodalCholesky, SolvesForDisplacementsOfAMesh) {
  const TetMesh mesh = test::box_mesh({5, 4, 3}, {1.0, 0.8, 0.6});
  const Eigen::VectorXd ones = Eigen::VectorXd::Ones(mesh.tet_count());
  const FlagVector fixed = (mesh.vertices.col(0).array() < 1e-9).cast<std::uint8_t>();
  const ElasticSystem system = build_elastic_system(mesh, {ones, ones, 0.3 * ones}, fixed);
  expect_solved(Matrix(Matrix(system.stiffness).triangularView<Eigen::Lower>()));
}

// Parts that nothing connects, and a matrix of one entry each.
TEST(SupernodalCholesky, SolvesForSeveralParts) {
  Eigen::MatrixXd A = Eigen::MatrixXd::Identity(9, 9) * 4;
  A(3, 1) = A(1, 3) = A(7, 3) = A(3, 7) = 1;
  A(5, 4) = A(4, 5) = -2;
  expect_solved(lower(A));
  expect_solved(lower(Eigen::MatrixXd::Identity(4, 4) * 2));
}

TEST(SupernodalCholesky, SeesMatricesThatAreNotPositiveDefiniteAndGoesOn) {
  Eigen::MatrixXd A = Eigen::MatrixXd::Identity(6, 6) * 2;
  A(4, 1) = A(1, 4) = 3;
  SupernodalCholesky factors(lower(A));
  EXPECT_FALSE(factors.factorise(lower(A)));
  A.diagonal().setConstant(5);
  ASSERT_TRUE(factors.factorise(lower(A)));
  const Eigen::VectorXd b = test::random_vector(6, 2);
  EXPECT_LE((A * factors.solve(b) - b).norm(), 1e-14 * b.norm());
}

}  // namespace
}  // namespace exmat::precompute
