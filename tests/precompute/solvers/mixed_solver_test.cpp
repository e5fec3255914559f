// Factors in single precision and block Davidson, against dense solvers in double.
#include "precompute/solvers/mixed_solver.h"

#include <gtest/gtest.h>
#include <string>
#include <vector>

#include "common/core/decompositions.h"
#include "common/core/error.h"
#include "common/core/log.h"
#include "precompute/fem/elastic_system.h"
#include "precompute/solvers/davidson.h"
#include "precompute/solvers/eigenpairs.h"
#include "precompute/solvers/ranks.h"
#include "tests/support/box_mesh.h"
#include "tests/support/random.h"

namespace exmat::precompute {
namespace mixed_solver_test {

ElasticSystem system_of(const TetMesh& mesh, bool clamped) {
  const Eigen::VectorXd ones = Eigen::VectorXd::Ones(mesh.tet_count());
  FlagVector fixed = FlagVector::Zero(mesh.vertex_count());
  if (clamped) fixed = (mesh.vertices.col(0).array() < 1e-9).cast<std::uint8_t>();
  return build_elastic_system(mesh, {1000 * ones, 1e6 * ones, 0.4 * ones}, fixed);
}

MixedSolver solver_of(const ElasticSystem& system) {
  return {system.stiffness, system.null_space, system.mass * system.null_space, 3,
          dissected_elimination(graph_of(system.stiffness, 3), 3)};
}

class Mixed : public testing::TestWithParam<bool> {
 protected:
  const ElasticSystem system_ = system_of(test::box_mesh({5, 4, 3}, {1.0, 0.8, 0.6}), GetParam());
};

// By the bordered matrix where the body is free.
TEST_P(Mixed, SolvesAsDenseFactorsDo) {
  const Eigen::Index n = system_.mass.rows(), c = system_.null_space.cols();
  const Eigen::MatrixXd MR = system_.mass * system_.null_space, B = test::random_matrix(n, 6, 1);
  Eigen::MatrixXd bordered = Eigen::MatrixXd::Zero(n + c, n + c), loads = Eigen::MatrixXd::Zero(n + c, 6);
  bordered.topLeftCorner(n, n) = system_.stiffness;
  bordered.topRightCorner(n, c) = 1e3 * MR;  // of the size of the other entries
  bordered.bottomLeftCorner(c, n) = 1e3 * MR.transpose();
  loads.topRows(n) = B;
  const Eigen::MatrixXd expected = bordered.partialPivLu().solve(loads).topRows(n);
  const MixedSolver solver = solver_of(system_);
  ASSERT_EQ(solver.objection(), "");
  EXPECT_LE((solver.solve(B) - expected).norm(), 1e-10 * expected.norm());
  RowMatrix rough = B;
  solver.precondition(rough);
  EXPECT_LE((rough - expected).norm(), 1e-3 * expected.norm());
}

TEST_P(Mixed, FindsTheEigenvectorsOfADenseSolver) {
  constexpr Eigen::Index kCount = 14;
  const Eigen::Index rigid = system_.null_space.cols();
  const Eigen::GeneralizedSelfAdjointEigenSolver<Eigen::MatrixXd> exact{Eigen::MatrixXd(system_.stiffness),
                                                                        Eigen::MatrixXd(system_.mass)};
  const MixedSolver solver = solver_of(system_);
  const Eigen::MatrixXd none(system_.mass.rows(), 0),
      found = davidson_eigenvectors(system_.stiffness, system_.mass, solver, none, kCount, 1e-10);
  // The whole space agrees, whatever multiple values do to single vectors.
  const Eigen::MatrixXd space = exact.eigenvectors().middleCols(rigid, kCount);
  const Eigen::MatrixXd outside = found - space * (space.transpose() * (system_.mass * found));
  EXPECT_LE((outside.transpose() * (system_.mass * outside)).diagonal().cwiseMax(0).cwiseSqrt().maxCoeff(), 1e-8);
  // In the complement of those the next ones.
  const Eigen::MatrixXd more = davidson_eigenvectors(system_.stiffness, system_.mass, solver, found, 1, 1e-10);
  EXPECT_NEAR(more.col(0).dot(system_.stiffness * more.col(0)) / exact.eigenvalues()[rigid + kCount], 1, 1e-10);
}

INSTANTIATE_TEST_SUITE_P(, Mixed, testing::Bool(), [](const auto& test) { return test.param ? "Clamped" : "Free"; });

// A square bar has its bending modes twice.
TEST(MixedSolver, FindsAllCopiesOfMultipleValues) {
  const ElasticSystem system = system_of(test::box_mesh({8, 2, 2}, {2.0, 0.5, 0.5}), false);
  const Eigen::GeneralizedSelfAdjointEigenSolver<Eigen::MatrixXd> exact{Eigen::MatrixXd(system.stiffness),
                                                                        Eigen::MatrixXd(system.mass)};
  for (const Eigen::Index count : {1, 2, 3, 7, 40}) {
    const Eigen::MatrixXd none(system.mass.rows(), 0),
        found = davidson_eigenvectors(system.stiffness, system.mass, solver_of(system), none, count, 1e-10);
    for (Eigen::Index k = 0; k < count; ++k)
      EXPECT_NEAR(found.col(k).dot(system.stiffness * found.col(k)) / exact.eigenvalues()[6 + k], 1, 1e-10);
  }
}

class SolverChoice : public testing::Test {
 protected:
  SolverChoice() {
    log::set_sink([this](log::Level, std::string_view message) { log_ += std::string(message) + "\n"; });
  }
  ~SolverChoice() override {
    log::set_sink({});
    configure_solvers({});
  }
  Eigen::VectorXd values(const ElasticSystem& system, const SolverSettings& settings) {
    configure_solvers(settings);
    log_.clear();
    const SemidefiniteSolver solver(system.stiffness, system.mass * system.null_space, "box", system.rigid);
    return smallest_eigenpairs(system.stiffness, system.mass, solver, 6).values;
  }

  std::string log_;
};

// Two boxes that share an edge: a null vector more than the rigid motions.
TEST_F(SolverChoice, HingesAreRefusedByFactorsInDouble) {
  TetMesh mesh = test::box_mesh({2, 2, 2}, {1, 1, 1}), other = mesh;
  const Eigen::Index n = mesh.vertex_count();
  std::vector<std::int32_t> number;
  TetMesh both = mesh;
  for (Eigen::Index v = 0; v < n; ++v) {
    const Eigen::RowVector3d x = mesh.vertices.row(v);
    if (x[0] > 1e-9 || x[1] > 1e-9) {
      number.push_back(static_cast<std::int32_t>(both.vertices.rows()));
      both.vertices.conservativeResize(both.vertices.rows() + 1, 3);
      both.vertices.bottomRows<1>() << -x[0], -x[1], x[2];
    } else {
      number.push_back(static_cast<std::int32_t>(v));
    }
  }
  both.tets.conservativeResize(2 * mesh.tet_count(), 4);
  for (Eigen::Index t = 0; t < mesh.tet_count(); ++t)
    for (int corner = 0; corner < 4; ++corner)
      both.tets(mesh.tet_count() + t, corner) = number[static_cast<std::size_t>(mesh.tets(t, corner))];
  const ElasticSystem system = system_of(both, false);
  EXPECT_THROW(values(system, {.eigensolver = Eigensolver::kMixed}), IllConditioned);
  EXPECT_NE(log_.find("factors in double in their place"), std::string::npos) << log_;
}

// Auto chooses by mesh and memory, and says so.
TEST_F(SolverChoice, AutoGoesByTheMeshAndTheMemory) {
  const ElasticSystem system = system_of(test::box_mesh({9, 5, 4}, {1.0, 0.8, 0.6}), true);
  const Eigen::VectorXd direct = values(system, {.eigensolver = Eigensolver::kDirect}), small = values(system, {});
  EXPECT_EQ(direct, small);
  EXPECT_EQ(log_, "");
  const auto expect_same = [&](const Eigen::VectorXd& found) {
    EXPECT_LE(((found - direct).array() / direct.array()).abs().maxCoeff(), 1e-8);
  };
  expect_same(values(system, {.large = 100}));
  EXPECT_NE(log_.find("factors in single precision"), std::string::npos) << log_;
  expect_same(values(system, {.large = 100, .memory = 10'000}));
  EXPECT_NE(log_.find("multigrid and LOBPCG in their place"), std::string::npos) << log_;
}

}  // namespace mixed_solver_test
}  // namespace exmat::precompute
