#include "precompute/full_space/sparse_direction.h"

#include <gtest/gtest.h>

#include "common/core/decompositions.h"
#include "common/mesh/assembly.h"
#include "tests/support/box_mesh.h"
#include "tests/support/random.h"

namespace exmat::precompute {
namespace {

class SparseDirectionTest : public testing::Test {
 protected:
  LowerTriangle matrix(double stiffness, double mass) const {
    const SparseMatrix sum = stiffness * laplacian_stiffness(mesh_) + mass * scalar_mass(mesh_);
    return LowerTriangle(LowerTriangle(sum).triangularView<Eigen::Lower>());
  }
  static SparseDirection::Product product_of(const LowerTriangle& matrix) {
    return [&matrix](const Eigen::VectorXd& x) { return Eigen::VectorXd(matrix.selfadjointView<Eigen::Lower>() * x); };
  }
  static double residual(const SparseDirection::Product& product, const Eigen::VectorXd& x, const Eigen::VectorXd& b) {
    return (product(x) - b).norm() / b.norm();
  }

  TetMesh mesh_ = test::cube_grid(4);
  Eigen::Index size_ = mesh_.vertex_count();
  Eigen::VectorXd b_ = test::random_vector(size_, 1), x_;
};

TEST_F(SparseDirectionTest, OwnFactorsTakeOneIterationAndOlderOnesServe) {
  LowerTriangle A = matrix(1, 5);
  const auto product = product_of(A);
  SparseDirection solver(A);
  ASSERT_TRUE(solver.solve(A, product, b_, x_));
  EXPECT_EQ(solver.iterations(), 1);
  EXPECT_LE(residual(product, x_, b_), 1e-12);
  A = matrix(1.1, 5);
  ASSERT_TRUE(solver.solve(A, product, b_, x_));
  EXPECT_EQ(solver.factorisations(), 1);
  EXPECT_LE(residual(product, x_, b_), 1e-5);
  A = matrix(1000, 0.1);  // nothing like it
  ASSERT_TRUE(solver.solve(A, product, b_, x_));
  EXPECT_EQ(solver.factorisations(), 2);
  EXPECT_LE(residual(product, x_, b_), 1e-5);
}

// The term has rank two: at most three different eigenvalues, and as many iterations.
TEST_F(SparseDirectionTest, SolvesWithATermThatIsNotInTheMatrix) {
  const LowerTriangle A = matrix(1, 5);
  const Eigen::MatrixXd low_rank = test::random_matrix(size_, 2, 2);
  const auto product = [&](const Eigen::VectorXd& x) -> Eigen::VectorXd {
    return product_of(A)(x) + 3 * low_rank * (low_rank.transpose() * x);
  };
  SparseDirection solver(A);
  ASSERT_TRUE(solver.solve(A, product, b_, x_));
  EXPECT_LE(solver.iterations(), 3);
  EXPECT_LE(residual(product, x_, b_), 1e-5);
}

TEST_F(SparseDirectionTest, SeesAnIndefiniteMatrixAndShiftsIt) {
  LowerTriangle A = matrix(1, -0.1);
  const auto product = product_of(A);
  SparseDirection solver(A);
  EXPECT_FALSE(solver.solve(A, product, b_, x_));
  const LowerTriangle before = A;
  ASSERT_TRUE(solver.solve_shifted(A, product, b_, x_));
  EXPECT_GT(x_.dot(b_), 0) << "no direction of descent";
  EXPECT_LE(residual(product, x_, b_), 1e-5);
  const LowerTriangle change = A - before;
  EXPECT_GT(change.diagonal().minCoeff(), 0);
  EXPECT_NEAR(change.norm(), change.diagonal().norm(), 1e-12);
}

}  // namespace
}  // namespace exmat::precompute
