#include "precompute/shape_space/laplace_basis.h"

#include <algorithm>
#include <gtest/gtest.h>
#include <numbers>
#include <vector>

#include "common/core/decompositions.h"
#include "precompute/solvers/eigenpairs.h"
#include "tests/support/box_mesh.h"

namespace exmat::precompute {
namespace {

// Neumann eigenvalues of a box, constant one dropped.
std::vector<double> box_eigenvalues(const std::array<double, 3>& lengths, std::size_t count) {
  std::vector<double> values;
  for (int i = 0; i < 8; ++i)
    for (int j = 0; j < 8; ++j)
      for (int k = 0; k < 8; ++k) {
        const double a = i / lengths[0], b = j / lengths[1], c = k / lengths[2];
        values.push_back(std::numbers::pi * std::numbers::pi * (a * a + b * b + c * c));
      }
  std::sort(values.begin(), values.end());
  return {values.begin() + 1, values.begin() + 1 + static_cast<std::ptrdiff_t>(count)};
}

TEST(LaplaceBasis, EigenvaluesOfABoxConvergeWithTheSquareOfTheMeshWidth) {
  const std::array<double, 3> lengths{1.3, 1.0, 0.7};
  const double volume = 1.3 * 0.7;
  const auto exact = box_eigenvalues(lengths, 8);
  const auto errors = [&](int n) {
    const auto basis = laplace_basis(test::box_mesh({n, n, n}, lengths), 8, "box");
    std::vector<double> result;
    for (std::size_t i = 0; i < exact.size(); ++i)
      result.push_back(basis.eigenvalues[static_cast<Eigen::Index>(i)] / (exact[i] * std::pow(volume, 2.0 / 3)) - 1);
    return result;
  };
  const auto coarse = errors(8), fine = errors(16);
  for (std::size_t i = 0; i < exact.size(); ++i) {
    EXPECT_GT(fine[i], 0) << i;  // a Galerkin method overestimates
    EXPECT_NEAR(coarse[i] / fine[i], 4.0, 0.35)
        << i;  // the next order is (lambda h^2)^2, at most 8 % of the leading one here
  }
}

TEST(LaplaceBasis, ResidualsAndOrthonormality) {
  const auto mesh = test::box_mesh({9, 6, 5}, {2.0, 1.1, 0.9});
  const auto basis = laplace_basis(mesh, 40, "box");
  const TetMesh normalised{basis.vertices, mesh.tets};
  const SparseMatrix S = laplacian_stiffness(normalised), M = scalar_mass(normalised);
  const Eigen::MatrixXd& phi = basis.eigenfunctions;
  EXPECT_LE((phi.transpose() * (M * phi) - Eigen::MatrixXd::Identity(40, 40)).cwiseAbs().maxCoeff(), 1e-12);
  const Eigen::MatrixXd scaled = (M * phi) * basis.eigenvalues.asDiagonal();
  const Eigen::VectorXd residuals = (S * phi - scaled).colwise().norm().cwiseQuotient(scaled.colwise().norm());
  EXPECT_LE(residuals.maxCoeff(), 1e-9);
  EXPECT_LE((Eigen::RowVectorXd::Ones(M.rows()) * (M * phi)).cwiseAbs().maxCoeff(), 1e-12);  // the constant one is out
}

TEST(LaplaceBasis, DoesNotDependOnScaleAndPlace) {
  auto mesh = test::box_mesh({6, 4, 3}, {2.0, 1.1, 0.9});
  const auto basis = laplace_basis(mesh, 10, "box");
  mesh.vertices *= 1e3;
  mesh.vertices.rowwise() += Eigen::RowVector3d(5e3, -1e3, 2e3);
  const auto scaled = laplace_basis(mesh, 10, "box");
  EXPECT_LE((scaled.eigenvalues - basis.eigenvalues).norm(), 1e-11 * basis.eigenvalues.norm());
  EXPECT_LE((scaled.eigenfunctions - basis.eigenfunctions).norm(), 1e-9 * basis.eigenfunctions.norm());
  EXPECT_LE((scaled.vertices - basis.vertices).norm(), 1e-11 * basis.vertices.norm());
}

// A cube has triple eigenvalues, and this mesh keeps them as clusters: none of the copies may be missed.
TEST(SmallestEigenpairs, FindsEveryCopyOfMultipleEigenvalues) {
  const auto mesh = test::cube_grid(5);
  const Eigen::MatrixXd S = laplacian_stiffness(mesh), M = scalar_mass(mesh);
  const Eigen::GeneralizedSelfAdjointEigenSolver<Eigen::MatrixXd> dense(S, M, Eigen::EigenvaluesOnly);
  const auto basis = laplace_basis(mesh, 30, "cube");
  const Eigen::VectorXd expected = dense.eigenvalues().segment(1, 30) * std::pow(125.0, 2.0 / 3);
  EXPECT_LE(((basis.eigenvalues - expected).array() / expected.array()).abs().maxCoeff(), 1e-10);
}

TEST(SplitsCluster, SeesNeighboursWithinTheGap) {
  const Eigen::VectorXd values = (Eigen::VectorXd(6) << 1.0, 2.0, 2.01, 2.02, 3.0, 3.01).finished();
  EXPECT_FALSE(splits_cluster(values, 1));
  EXPECT_TRUE(splits_cluster(values, 2));
  EXPECT_TRUE(splits_cluster(values, 3));
  EXPECT_FALSE(splits_cluster(values, 4));
  EXPECT_EQ(next_uncut(values, 2), 4);
  EXPECT_EQ(next_uncut(values, 5), 6);
}

TEST(FixSigns, TheFirstOfTheLargestEntriesIsPositive) {
  Eigen::MatrixXd columns(3, 2);
  columns << -2, 1, 2 + 1e-9, -3, 1, 2;
  fix_signs(columns);
  EXPECT_GT(columns(0, 0), 0);  // equal in magnitude but for rounding: the first one counts
  EXPECT_GT(columns(1, 1), 0);
}

}  // namespace
}  // namespace exmat::precompute
