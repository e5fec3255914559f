// Eigenpairs of slender bodies and of meshes with flat tets, against subspace iteration in long double.
#include "precompute/solvers/eigenpairs.h"

#include <Eigen/SparseCholesky>
#include <cmath>
#include <fmt/format.h>
#include <gtest/gtest.h>

#include "common/core/decompositions.h"
#include "precompute/fem/elastic_system.h"
#include "precompute/solvers/refinement.h"
#include "tests/support/box_mesh.h"
#include "tests/support/flat_tets.h"
#include "tests/support/random.h"

namespace exmat::precompute {
namespace {

constexpr int kCount = 8;
constexpr double kYoung = 1e6, kDensity = 1000, kPoisson = 0.3;

using Extended = Eigen::Matrix<long double, Eigen::Dynamic, Eigen::Dynamic>;
using ExtendedSparse = Eigen::SparseMatrix<long double>;

ElasticSystem system_of(const TetMesh& mesh, bool clamped) {
  const Eigen::VectorXd ones = Eigen::VectorXd::Ones(mesh.tet_count());
  FlagVector fixed = FlagVector::Zero(mesh.vertex_count());
  if (clamped) fixed = (mesh.vertices.col(0).array() < 1e-9).cast<std::uint8_t>();
  return build_elastic_system(mesh, {kDensity * ones, kYoung * ones, kPoisson * ones}, fixed);
}

Eigenpairs pairs_of(const ElasticSystem& system) {
  const SemidefiniteSolver solver(system.stiffness, system.mass * system.null_space, "body", system.rigid);
  return smallest_eigenpairs(system.stiffness, system.mass, solver, kCount);
}

// The least values but the first `rigid`: of (K + s M)^-1, s of the size of the smallest, by simultaneous iteration.
Eigen::VectorXd reference_values(const SparseMatrix& stiffness, const SparseMatrix& mass, Eigen::Index rigid,
                                 double shift) {
  const ExtendedSparse K = stiffness.cast<long double>(), M = mass.cast<long double>();
  const ExtendedSparse shifted = K + static_cast<long double>(shift) * M;
  const Eigen::SimplicialLDLT<ExtendedSparse> factors(shifted);
  const Eigen::Index size = 2 * kCount + rigid;
  Extended x = test::random_matrix(mass.rows(), size, 1).cast<long double>();
  Eigen::VectorXd values = Eigen::VectorXd::Zero(size), last;
  for (int pass = 0; pass < 60; ++pass) {
    last = values;
    x = factors.solve(Extended(M * x));
    const Eigen::GeneralizedSelfAdjointEigenSolver<Extended> ritz(x.transpose() * (K * x), x.transpose() * (M * x));
    x = (x * ritz.eigenvectors()).eval();
    values = ritz.eigenvalues().cast<double>();
    const auto kept = Eigen::seqN(rigid, kCount);
    if (((values(kept) - last(kept)).array().abs() < 1e-12 * values(kept).array()).all()) break;
  }
  return values.segment(rigid, kCount);
}

// Largest relative difference.
double error_of(const Eigenpairs& pairs, const SparseMatrix& stiffness, const SparseMatrix& mass, Eigen::Index rigid) {
  const Eigen::VectorXd reference = reference_values(stiffness, mass, rigid, 0.1 * pairs.values[0]);
  return ((pairs.values - reference).array() / reference.array()).abs().maxCoeff();
}

// Lengths over the width: relative values of K's largest and smallest grow with the fourth power.
struct Body {
  const char* name;
  int cells;  // along; 2 x 2 across
  bool clamped;
};

class SlenderBars : public testing::TestWithParam<Body> {};

// The solution with the shifted matrix takes up to 8 of the 19 digits of long double.
TEST_P(SlenderBars, HaveTheEigenvaluesOfLongDouble) {
  const Body& body = GetParam();
  const ElasticSystem system = system_of(test::box_mesh({body.cells, 2, 2}, {0.5 * body.cells, 1, 1}), body.clamped);
  const Eigenpairs pairs = pairs_of(system);
  const double found = error_of(pairs, system.stiffness, system.mass, system.null_space.cols());
  const double unit =
      (pairs.vectors.transpose() * (system.mass * pairs.vectors) - Eigen::MatrixXd::Identity(kCount, kCount))
          .cwiseAbs()
          .maxCoeff();
  fmt::print("{}: eigenvalues {:.1e}, orthonormal to {:.1e}\n", body.name, found, unit);
  EXPECT_LE(found, 1e-11);
  EXPECT_LE(unit, 1e-13);
}

INSTANTIATE_TEST_SUITE_P(, SlenderBars,
                         testing::Values(Body{"Clamped40", 80, true}, Body{"Clamped80", 160, true},
                                         Body{"Free80", 160, false}),
                         [](const auto& body) { return body.param.name; });

// Euler and Bernoulli's cantilever: omega = k^2 sqrt(E I / rho A), k L = 1.8751. Linear tets are too stiff, by an error
// that falls with the square of their size: a quarter of the width has a quarter of the error of half the width.
TEST(SlenderBar, BendsAsEulerAndBernoulliSay) {
  constexpr double kLength = 20, kRoot = 1.875104068711961;
  const double expected = std::pow(kRoot / kLength, 4) * kYoung / (12 * kDensity);
  const auto excess = [&](int across) {
    const int along = static_cast<int>(kLength) * across;
    const Eigenpairs pairs = pairs_of(system_of(test::box_mesh({along, across, across}, {kLength, 1, 1}), true));
    return pairs.values[0] / expected - 1;
  };
  const double coarse = excess(2), fine = excess(4);
  fmt::print("excess of omega^2: {:.3f}, {:.3f}, extrapolated {:.4f}\n", coarse, fine, fine - (coarse - fine) / 3);
  EXPECT_GT(fine, 0);
  EXPECT_NEAR(fine - (coarse - fine) / 3, 0, 0.03);
}

// Heights are relative to the edge. What is lost in double is the rounding of the matrix itself.
class FlatTets : public testing::TestWithParam<double> {
 protected:
  static void expect_exact(const char* what, const Eigenpairs& pairs, const SparseMatrix& stiffness,
                           const SparseMatrix& mass, Eigen::Index rigid) {
    const double found = error_of(pairs, stiffness, mass, rigid);
    const double rounding = rounding_share(stiffness, mass, pairs.values, pairs.vectors);
    fmt::print("{}: {:.1e}, by rounding up to {:.1e}\n", what, found, rounding);
    EXPECT_LE(found, 1e-11 + rounding);
  }

  TetMesh mesh_ = test::with_flat_tets(test::box_mesh({9, 3, 3}, {2.25, 0.75, 0.75}), 10, GetParam());
};

TEST_P(FlatTets, GiveBodiesTheEigenvaluesOfLongDouble) {
  for (const bool clamped : {true, false}) {
    const ElasticSystem system = system_of(mesh_, clamped);
    expect_exact(clamped ? "clamped" : "free", pairs_of(system), system.stiffness, system.mass,
                 system.null_space.cols());
  }
}

// Its factors take more work space than the pattern needs.
TEST_P(FlatTets, GiveTheLaplacianTheEigenvaluesOfLongDouble) {
  const SparseMatrix stiffness = laplacian_stiffness(mesh_), mass = scalar_mass(mesh_);
  const Eigen::MatrixXd ones = Eigen::MatrixXd::Ones(mesh_.vertex_count(), 1);
  const Eigen::MatrixXd constant = ones / std::sqrt(ones.col(0).dot(mass * ones.col(0)));
  const SemidefiniteSolver solver(stiffness, mass * constant, "Laplacian", constant);
  expect_exact("Laplacian", smallest_eigenpairs(stiffness, mass, solver, kCount), stiffness, mass, 1);
}

INSTANTIATE_TEST_SUITE_P(, FlatTets, testing::Values(1e-3, 1e-5, 1e-8));

// Most of all eigenpairs: the sums of all values and of their squares are traces of M^-1 K.
// The search did not end for a soft body, or in units that make it one.
TEST(Eigenpairs, AreTheSameInAnyUnits) {
  for (const bool clamped : {false, true}) {
    ElasticSystem system = system_of(test::box_mesh({24, 2, 2}, {2.4, 0.2, 0.2}), clamped);
    const Eigen::VectorXd expected = pairs_of(system).values;
    for (const double share : {1e-20, 1e-11, 1e-6}) {
      ElasticSystem other = system;
      other.stiffness *= share;
      EXPECT_LE((pairs_of(other).values / share - expected).cwiseQuotient(expected).cwiseAbs().maxCoeff(), 1e-8)
          << share << (clamped ? ", clamped" : "");
    }
  }
}

TEST(Eigenpairs, NearlyAllOfASmallBodyAreFound) {
  const TetMesh mesh = test::box_mesh({3, 2, 2}, {3, 2, 1});  // 36 vertices
  for (const bool clamped : {false, true}) {
    const ElasticSystem system = system_of(mesh, clamped);
    const Eigen::Index all = system.mass.rows() - system.null_space.cols();
    const SemidefiniteSolver solver(system.stiffness, system.mass * system.null_space, "body", system.rigid);
    const Eigenpairs most = smallest_eigenpairs(system.stiffness, system.mass, solver, all - 2),
                     whole = smallest_eigenpairs(system.stiffness, system.mass, solver, all);
    const Eigen::MatrixXd product = Eigen::MatrixXd(system.mass).llt().solve(Eigen::MatrixXd(system.stiffness));
    EXPECT_NEAR(whole.values.sum(), product.trace(), 1e-9 * product.trace());
    EXPECT_NEAR(whole.values.squaredNorm(), (product * product).trace(), 1e-9 * (product * product).trace());
    EXPECT_LT((most.values - whole.values.head(all - 2)).cwiseAbs().maxCoeff(), 1e-9 * whole.values[0]);
    const Eigen::MatrixXd residual =
        system.stiffness * most.vectors - system.mass * most.vectors * most.values.asDiagonal();
    EXPECT_LT(residual.colwise().norm().maxCoeff(),
              1e-9 * (system.stiffness * most.vectors).colwise().norm().maxCoeff());
    EXPECT_THROW(smallest_eigenpairs(system.stiffness, system.mass, solver, all + 1), WorkError);
  }
}

}  // namespace
}  // namespace exmat::precompute
