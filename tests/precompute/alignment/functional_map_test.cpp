#include "precompute/alignment/functional_map.h"

#include <gtest/gtest.h>
#include <numeric>
#include <random>
#include <unsupported/Eigen/MatrixFunctions>

#include "common/core/decompositions.h"
#include "precompute/alignment/coupled_bases.h"
#include "precompute/alignment/spectral_tree.h"
#include "tests/support/posed_bodies.h"
#include "tests/support/random.h"

namespace exmat::precompute {
namespace {

// A bar without symmetry: its section shrinks along it and bends.
TetMesh wedge(std::uint32_t seed) {
  TetMesh mesh = test::centred(test::shaken_box({9, 4, 3}, {2, 1, 0.6}, seed));
  for (auto x : mesh.vertices.rowwise()) {
    x[1] *= 1 - 0.2 * x[0];
    x[2] += 0.15 * x[1] * x[0] + 0.1 * x[0];
  }
  return mesh;
}

// The same mesh with its vertices in another order: vertex v of the first is order[v] of the second.
struct Reordered {
  TetMesh mesh;
  std::vector<std::int32_t> order;
};
Reordered reordered(const TetMesh& mesh) {
  Reordered result{mesh, std::vector<std::int32_t>(static_cast<std::size_t>(mesh.vertex_count()))};
  std::iota(result.order.begin(), result.order.end(), 0);
  std::shuffle(result.order.begin(), result.order.end(), std::mt19937(3));
  for (Eigen::Index v = 0; v < mesh.vertex_count(); ++v)
    result.mesh.vertices.row(result.order[static_cast<std::size_t>(v)]) = mesh.vertices.row(v);
  for (auto& corner : result.mesh.tets.reshaped()) corner = result.order[static_cast<std::size_t>(corner)];
  return result;
}

struct Pair {
  Reordered other = reordered(wedge(1));
  AlignedShape a = aligned_shape(wedge(1), 0, "a"), b = aligned_shape(other.mesh, 0, "b");
  Eigen::MatrixXd truth(Eigen::Index size) const {
    const Eigen::MatrixXd values = b.basis.eigenfunctions.leftCols(size)(other.order, Eigen::all);
    return a.basis.eigenfunctions.leftCols(size).transpose() * (a.basis.mass * values);
  }
};
const Pair& pair_of_wedges() {
  static const Pair pair;
  return pair;
}

TEST(ZoomOut, RecoversAPermutationFromANoisyStart) {
  const Pair& pair = pair_of_wedges();
  const ZoomOut zoom_out(pair.a, pair.b, zoom_out_sizes(60), 10000);
  const Eigen::MatrixXd start = pair.truth(20) + 0.05 * test::random_matrix(20, 20, 5);
  const Eigen::MatrixXd map = zoom_out.refine(start);
  EXPECT_EQ(map.rows(), 40);
  const IndexVector points = zoom_out.points(map);
  ASSERT_EQ(points.size(), pair.a.mesh.vertex_count());
  for (Eigen::Index k = 0; k < points.size(); ++k)
    EXPECT_EQ(points[k], pair.other.order[static_cast<std::size_t>(zoom_out.samples()[static_cast<std::size_t>(k)])]);
  EXPECT_LE(orthogonality_defect(map), 1e-9);
}

// The body is the same, so all eigenvalues agree and the best branch is the map itself, up to signs of no function.
TEST(SpectralMaps, FindTheMapOfABodyWithoutSymmetry) {
  const Pair& pair = pair_of_wedges();
  const auto maps = spectral_maps(pair.a, pair.b, 20, 3);
  ASSERT_EQ(maps.size(), 3U);
  EXPECT_LE((maps.front() - pair.truth(20)).norm(), 1e-6);
}

TEST(SpectralMaps, ChoicesOfClustersAreOrthogonalAndDistinct) {
  for (const auto& [size, count] : {std::pair{1, 2}, {2, 16}, {3, 48}}) {
    const auto choices = cluster_choices(size);
    ASSERT_EQ(static_cast<int>(choices.size()), count);
    for (std::size_t i = 0; i < choices.size(); ++i) {
      EXPECT_LE((choices[i].transpose() * choices[i] - Eigen::MatrixXd::Identity(size, size)).norm(), 1e-14);
      for (std::size_t j = 0; j < i; ++j) EXPECT_GT((choices[i] - choices[j]).norm(), 0.1);
    }
  }
  const Eigen::VectorXd a = (Eigen::VectorXd(5) << 1, 2, 2.01, 4, 9).finished(),
                        b = (Eigen::VectorXd(5) << 1, 2, 2.3, 4, 4.1).finished();
  const auto clusters = common_clusters(a, b, 5);
  ASSERT_EQ(clusters.size(), 3U);
  EXPECT_EQ(clusters[1].size, 2);
  EXPECT_EQ(clusters[2].first, 3);
}

// The heat kernel of a vertex is exp(-t M^-1 S) M^-1 e_l; a dense matrix exponential shares nothing with the
// eigenpairs. The one function that the eigensolver leaves out decays by exp(-t lambda_max) < 1e-9.
TEST(HeatKernels, AgreeWithTheDenseExponential) {
  const TetMesh mesh{normalised_positions(test::shaken_box({3, 2, 2}, {2, 1, 0.8}, 2)),
                     test::box_mesh({3, 2, 2}, {2, 1, 0.8}).tets};
  const LaplaceBasis basis = laplace_basis(mesh, mesh.vertex_count() - 2, "mesh");
  const Eigen::MatrixXd M = scalar_mass(mesh), S = laplacian_stiffness(mesh);
  const Eigen::Vector2d times(0.1, 0.3);
  const Eigen::Vector2i vertices(4, 17);
  const Eigen::MatrixXd kernels = heat_kernels(basis.eigenvalues, basis.eigenfunctions(vertices, Eigen::all), times);
  for (int s = 0; s < 2; ++s) {
    const Eigen::MatrixXd generator = -times[s] * M.llt().solve(S);
    const Eigen::MatrixXd heat = generator.exp() * M.inverse();
    for (int l = 0; l < 2; ++l) {
      const Eigen::VectorXd expected = (basis.eigenfunctions.transpose() * M * heat.col(vertices[l])).normalized();
      EXPECT_LE((kernels.col(2 * s + l) - expected).norm(), 1e-8);
    }
  }
}

// 1e-4: the least squares have a ridge of 1e-9 and descriptors whose singular values fall to 1e-3 of the largest.
TEST(LandmarkMap, OfTheSameBodyIsItsMap) {
  const Pair& pair = pair_of_wedges();
  SparseMatrix on_a(8, pair.a.mesh.vertex_count()), on_b(8, pair.b.mesh.vertex_count());
  for (int k = 0; k < 8; ++k) {
    const int vertex = 25 * k;
    on_a.insert(k, vertex) = 1;
    on_b.insert(k, pair.other.order[static_cast<std::size_t>(vertex)]) = 1;
  }
  EXPECT_LE((landmark_map(pair.a, on_a, pair.b, on_b, 20) - pair.truth(20)).norm(), 1e-4);
}

CouplingProblem random_problem() {
  CouplingProblem problem;
  problem.lambda_a = Eigen::VectorXd::LinSpaced(6, 1, 9);
  problem.lambda_b = Eigen::VectorXd::LinSpaced(9, 1.1, 14);
  problem.F = test::random_matrix(6, 8, 1);
  problem.G = test::random_matrix(9, 8, 2);
  problem.coupling = 0.7;
  return problem;
}

// Central differences, in all of space: the constraint plays no part.
TEST(CoupledBases, GradientAgreesWithDifferences) {
  const CouplingProblem problem = random_problem();
  const Eigen::MatrixXd A = test::random_matrix(6, 6, 3), B = test::random_matrix(9, 6, 4),
                        dA = test::random_matrix(6, 6, 5), dB = test::random_matrix(9, 6, 6);
  constexpr double kStep = 1e-5;
  const double difference = (coupling_objective(problem, A + kStep * dA, B + kStep * dB) -
                             coupling_objective(problem, A - kStep * dA, B - kStep * dB)) /
                            (2 * kStep);
  const CouplingGradient gradient = coupling_gradient(problem, A, B);
  const double slope = gradient.A.cwiseProduct(dA).sum() + gradient.B.cwiseProduct(dB).sum();
  EXPECT_NEAR(slope, difference, 1e-7 * std::abs(difference));
}

TEST(CoupledBases, StayOrthonormalAndDescend) {
  const CouplingProblem problem = random_problem();
  const CoupledBases bases = couple_bases(problem, polar_factor(test::random_matrix(6, 9, 7)));
  const Eigen::MatrixXd I = Eigen::MatrixXd::Identity(6, 6);
  EXPECT_LE((bases.A.transpose() * bases.A - I).norm(), 1e-12);
  EXPECT_LE((bases.B.transpose() * bases.B - I).norm(), 1e-12);
  ASSERT_GT(bases.objective.size(), 5U);
  for (std::size_t k = 1; k < bases.objective.size(); ++k) EXPECT_LT(bases.objective[k], bases.objective[k - 1]);
  EXPECT_NEAR(bases.objective.back(), coupling_objective(problem, bases.A, bases.B), 1e-12 * bases.objective.back());
}

// The same spectra, and functions that a signed permutation relates: the coupling is that permutation, at objective 0.
TEST(CoupledBases, RecoverSignsOfTheSameBody) {
  CouplingProblem problem = random_problem();
  problem.lambda_b = problem.lambda_a;
  Eigen::MatrixXd truth = Eigen::MatrixXd::Identity(6, 6);
  truth(1, 1) = truth(4, 4) = -1;
  problem.G = truth.transpose() * problem.F;
  const CoupledBases bases = couple_bases(problem, polar_factor(truth + 0.2 * test::random_matrix(6, 6, 8)));
  EXPECT_LE((bases.functional_map() - truth).norm(), 1e-2);
  EXPECT_LE(bases.objective.back(), 1e-4 * bases.objective.front());
}

}  // namespace
}  // namespace exmat::precompute
