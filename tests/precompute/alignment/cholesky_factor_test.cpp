#include "precompute/alignment/cholesky_factor.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "common/core/decompositions.h"
#include "common/core/error.h"
#include "common/mesh/assembly.h"
#include "tests/support/box_mesh.h"

namespace exmat::precompute {
namespace {

// Single precision has 6e-8; the matrix's condition, about 1e2, is what it may lose.
TEST(CholeskyFactor, SolvesWhatADenseSolverSolves) {
  const TetMesh mesh = test::box_mesh({5, 4, 3}, {1, 1, 1});
  const Eigen::SparseMatrix<double> matrix = laplacian_stiffness(mesh) + 10 * scalar_mass(mesh);
  const VertexArray right = VertexArray::Random(mesh.vertex_count(), 3);
  const VertexArray expected = Eigen::MatrixXd(matrix).llt().solve(Eigen::MatrixXd(right));
  const VertexArray solved = CholeskyFactor(matrix, "test").solve(right);
  EXPECT_LE((solved - expected).norm(), 1e-5 * expected.norm());
}

TEST(CholeskyFactor, RefusesASingularMatrix) {
  Eigen::SparseMatrix<double> matrix(3, 3);
  matrix.insert(0, 0) = 1;
  matrix.insert(1, 1) = -1;
  matrix.insert(2, 2) = 1;
  try {
    const CholeskyFactor factor(matrix, "the step");
    ADD_FAILURE() << "no WorkError";
  } catch (const WorkError& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr("the step"));
  }
}

}  // namespace
}  // namespace exmat::precompute
