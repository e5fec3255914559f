#include <cmath>
#include <fmt/format.h>
#include <gtest/gtest.h>

#include "common/core/error.h"
#include "precompute/fem/elastic_system.h"
#include "precompute/shape_space/laplace_basis.h"
#include "precompute/solvers/eigenpairs.h"
#include "precompute/solvers/ranks.h"
#include "tests/support/box_mesh.h"

namespace exmat::precompute {
namespace eigensolver_test {

// Both have residuals below 1e-9, and eigenvalues have the error of the residual squared.
constexpr double kTolerance = 1e-8;
constexpr int kCount = 12;

const TetMesh& box() {
  static const TetMesh mesh = test::box_mesh({14, 7, 6}, {2.0, 1.0, 0.8});  // 3,528 tets
  return mesh;
}

ElasticSystem system_of(bool clamped) {
  const Eigen::VectorXd ones = Eigen::VectorXd::Ones(box().tet_count());
  FlagVector fixed = FlagVector::Zero(box().vertex_count());
  if (clamped) fixed = (box().vertices.col(0).array() < 1e-9).cast<std::uint8_t>();
  return build_elastic_system(box(), {1000 * ones, 1e6 * ones, 0.4 * ones}, fixed);
}

Eigenpairs elastic_pairs(const ElasticSystem& system) {
  const SemidefiniteSolver solver(system.stiffness, system.mass * system.null_space, "box", system.rigid);
  return smallest_eigenpairs(system.stiffness, system.mass, solver, kCount);
}

double difference(const Eigen::VectorXd& values, const Eigen::VectorXd& reference) {
  return ((values - reference).array() / reference.array()).abs().maxCoeff();
}

class Eigensolvers : public testing::TestWithParam<Eigensolver> {
 protected:
  void TearDown() override { configure_solvers({}); }

  template <typename Values>
  void expect_those_of_the_direct_one(const char* what, Values values) {
    configure_solvers({});
    const Eigen::VectorXd reference = values();
    configure_solvers({GetParam(), {}});
    const double found = difference(values(), reference);
    fmt::print("{}: {:.1e}\n", what, found);
    EXPECT_LE(found, kTolerance);
  }
};

TEST_P(Eigensolvers, GiveTheLaplacianTheSameEigenvalues) {
  expect_those_of_the_direct_one("Laplacian", [] { return laplace_basis(box(), kCount, "box").eigenvalues; });
}

TEST_P(Eigensolvers, GiveAFreeBodyTheSameEigenvalues) {
  const ElasticSystem system = system_of(false);
  expect_those_of_the_direct_one("free", [&] { return elastic_pairs(system).values; });
}

TEST_P(Eigensolvers, GiveAClampedBodyTheSameEigenvalues) {
  const ElasticSystem system = system_of(true);
  expect_those_of_the_direct_one("clamped", [&] { return elastic_pairs(system).values; });
}

// K X = (I - M R R^T) B, against the factorisation.
TEST_P(Eigensolvers, SolveAsTheDirectOne) {
  const ElasticSystem system = system_of(false);
  const Eigen::MatrixXd loads = Eigen::MatrixXd::Random(system.mass.rows(), 3);
  const auto solve = [&] {
    return SemidefiniteSolver(system.stiffness, system.mass * system.null_space, "box", system.rigid).solve(loads);
  };
  const Eigen::MatrixXd reference = solve();
  configure_solvers({GetParam(), {}});
  EXPECT_LE((solve() - reference).norm() / reference.norm(), kTolerance);
}

class MultigridSolvers : public Eigensolvers {};

TEST_P(MultigridSolvers, RefuseOptionsThatNothingTakes) {
  configure_solvers({GetParam(), {{"eps_ncv", "40"}, {"eps_nvc", "40"}}});
  try {
    laplace_basis(box(), kCount, "box");
    FAIL() << "taken";
  } catch (const InputError& error) {
    EXPECT_EQ(error.complaint().place, "--eps-nvc");
  }
}

INSTANTIATE_TEST_SUITE_P(, Eigensolvers,
                         testing::Values(Eigensolver::kMixed, Eigensolver::kGamg, Eigensolver::kLobpcg));
INSTANTIATE_TEST_SUITE_P(, MultigridSolvers, testing::Values(Eigensolver::kGamg, Eigensolver::kLobpcg));

}  // namespace eigensolver_test
}  // namespace exmat::precompute
