#include "precompute/posing/surface_pose.h"

#include <Eigen/Geometry>
#include <cmath>
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <numbers>
#include <numeric>

#include "common/core/decompositions.h"
#include "common/core/error.h"
#include "precompute/posing/missed_pose.h"
#include "precompute/posing/surface_springs.h"
#include "precompute/posing/volume_guard.h"
#include "tests/support/pose_energy.h"
#include "tests/support/surfaces.h"

namespace exmat::precompute {
namespace {

constexpr double kLength = 4;

// A bar of 4 x 1 x 1 m in tets that stand off it, as those of a cage do.
struct SurfacePoseTest : testing::Test {
  SurfaceMesh surface = test::box_surface({24, 6, 6}, {kLength, 1, 1});
  TetMesh cage = [] {
    TetMesh mesh = test::box_mesh({14, 4, 4}, {kLength + 0.3, 1.3, 1.3});
    mesh.vertices.array() -= 0.15;
    return mesh;
  }();
  Embedding embedding = embed_points(cage, surface.vertices, "bar");

  SurfacePose pose(const VertexArray& posed) const {
    return pose_by_surface(cage, surface, embedding, posed, cage.vertices, "pose");
  }
};

VertexArray twisted(VertexArray x, double angle) {
  for (auto point : x.rowwise()) {
    const double turn = angle * point[0] / kLength, y = point[1] - 0.5, z = point[2] - 0.5;
    point[1] = 0.5 + std::cos(turn) * y - std::sin(turn) * z;
    point[2] = 0.5 + std::sin(turn) * y + std::cos(turn) * z;
  }
  return x;
}

VertexArray bent(VertexArray x, double angle) {
  const double radius = kLength / angle;
  for (auto point : x.rowwise()) {
    const double turn = point[0] / radius, r = radius - (point[1] - 0.5);
    point[0] = r * std::sin(turn);
    point[1] = radius - r * std::cos(turn);
  }
  return x;
}

TEST_F(SurfacePoseTest, RigidMotionsTakeNoEnergy) {
  const Eigen::Matrix3d rotation = Eigen::AngleAxisd(3, Eigen::Vector3d(1, 1, -1).normalized()).toRotationMatrix();
  const auto move = [&](const VertexArray& points) -> VertexArray {
    return (points * rotation.transpose()).rowwise() + Eigen::RowVector3d(5, -6, 7);
  };
  const SurfacePose found = pose(move(surface.vertices));
  EXPECT_LT((found.positions - move(cage.vertices)).norm() / std::sqrt(cage.vertex_count()), 1e-9);
  EXPECT_LT(found.rms, 1e-9);
  EXPECT_LT(found.energy, 1e-12);
}

// No places of the cage's vertices have less of what is minimised than those found, energy and springs together: not
// those of the map that made the pose, either.
TEST_F(SurfacePoseTest, TakesNoMoreEnergyThanTheMapThatMadeThePose) {
  const double diagonal = bounding_box_diagonal(surface.vertices), volume = diagonal * diagonal * diagonal;
  const Eigen::VectorXd shares = vertex_shares(surface);
  for (const auto& [posed, own] :
       {std::pair(twisted(surface.vertices, std::numbers::pi), twisted(cage.vertices, std::numbers::pi)),
        std::pair(bent(surface.vertices, 2), bent(cage.vertices, 2))}) {
    const SurfacePose found = pose(posed);
    const VertexArray missed = (embedding.points.interpolation(cage) * own - posed) / diagonal;
    const double reference = test::pose_energy(cage, own) / volume,
                 reference_springs = found.stiffness * missed.rowwise().squaredNorm().dot(shares) / 2,
                 energy = found.energy / volume, springs = found.stiffness * found.rms * found.rms / 2;
    EXPECT_NEAR(energy, test::pose_energy(cage, found.positions) / volume, 1e-9 * reference);
    EXPECT_LT(energy + springs, reference + reference_springs);
    EXPECT_GT(energy, 0.7 * reference);  // a relaxed pose, not an escape from the springs
    EXPECT_LT(energy, 1.3 * reference);  // the springs leave no folds
  }
}

// To a stretch by which the whole bar changes alike the answer is that stretch, also outside the surface, where stress
// would be left over: there the tets relax by what the springs at the surface let them.
TEST_F(SurfacePoseTest, SquashesArriveInside) {
  const Eigen::RowVector3d factors(0.5, std::sqrt(2.0), std::sqrt(2.0));
  const SurfacePose found = pose(surface.vertices * factors.asDiagonal());
  EXPECT_LT(found.rms, 0.002);
  const VertexArray ideal = cage.vertices * factors.asDiagonal();
  for (Eigen::Index v = 0; v < cage.vertex_count(); ++v) {
    const Eigen::RowVector3d x = cage.vertices.row(v);
    const bool deep = x[0] > 1 && x[0] < 3 && x[1] > 0.3 && x[1] < 0.7 && x[2] > 0.3 && x[2] < 0.7;
    if (deep) {
      EXPECT_LT((found.positions.row(v) - ideal.row(v)).norm(), 0.01);
    }
  }
}

TEST_F(SurfacePoseTest, TheNearestKnownPoseIsMovedOntoTheNextOne) {
  const Eigen::Matrix3d rotation = Eigen::AngleAxisd(2, Eigen::Vector3d(1, -1, 2).normalized()).toRotationMatrix();
  const auto move = [&](const VertexArray& points) -> VertexArray {
    return (points * rotation.transpose()).rowwise() + Eigen::RowVector3d(3, 1, -2);
  };
  std::vector<KnownPose> known;
  for (const double angle : {1e-6, 1.0, 2.0, 3.0})
    known.push_back({bent(surface.vertices, angle), bent(cage.vertices, angle)});
  const VertexArray posed = move(bent(surface.vertices, 2));
  EXPECT_LT((nearest_cage(known, posed) - move(known[2].cage)).norm(), 1e-12 * posed.norm());
  EXPECT_LT((nearest_cage(known, move(bent(surface.vertices, 2.2))) - move(bent(cage.vertices, 2.2))).norm(),
            (move(known[2].cage) - move(bent(cage.vertices, 2.2))).norm());
}

class LargePose : public SurfacePoseTest, public testing::WithParamInterface<int> {};
TEST_P(LargePose, Arrives) {
  const std::array<VertexArray, 4> poses = {
      twisted(surface.vertices, std::numbers::pi), bent(surface.vertices, 2 * std::numbers::pi / 3),
      twisted(surface.vertices, 2 * std::numbers::pi), bent(surface.vertices, 1.5 * std::numbers::pi)};
  const SurfacePose found = pose(poses[static_cast<std::size_t>(GetParam())]);
  EXPECT_LT(found.rms, 0.01);
  EXPECT_LT(found.farthest, 0.03);
  EXPECT_GT(tet_volumes({found.positions, cage.tets}).minCoeff(), 0);
}
INSTANTIATE_TEST_SUITE_P(Poses, LargePose, testing::Range(0, 4));

// No body can do this: the tets stay sound, and what that misses is said.
TEST_F(SurfacePoseTest, PosesThatFoldOverThemselvesAreMissed) {
  VertexArray folded = surface.vertices;
  for (auto point : folded.rowwise())
    if (point[0] > 2) point[0] = 4 - point[0];  // the second half through the first, mirrored
  const SurfacePose found = pose(folded);
  EXPECT_GT(tet_volumes({found.positions, cage.tets}).minCoeff(), 0);
  EXPECT_GT(found.rms, 0.02);
}

// Two legs in one cage, as where cells bridge a gap: the tets between them are squeezed to a share of 1/25 and sheared.
// The pose arrives, and no tet is turned inside out.
TEST(BridgedPose, ArrivesWithoutTetsInsideOut) {
  const SurfaceMesh leg = test::box_surface({16, 4, 4}, {4, 1, 1});
  SurfaceMesh other = leg;
  other.vertices.col(1).array() += 1.5;
  const SurfaceMesh legs = test::together(leg, other);
  TetMesh cage = test::box_mesh({12, 12, 4}, {4.3, 3, 1.3});
  cage.vertices.rowwise() -= Eigen::RowVector3d(0.15, 0.25, 0.15);
  VertexArray posed = legs.vertices;
  for (auto point : posed.bottomRows(other.vertices.rows()).rowwise()) {
    point[1] -= 0.48;
    point[2] += 0.2 * point[0];
  }
  const Embedding embedding = embed_points(cage, legs.vertices, "legs");
  const SurfacePose found = pose_by_surface(cage, legs, embedding, posed, cage.vertices, "closed");
  EXPECT_GT(tet_volumes({found.positions, cage.tets}).minCoeff(), 0);
  EXPECT_LT(found.rms, 0.002);
}

TEST_F(SurfacePoseTest, TheReasonOfAMissIsTold) {
  const auto reason = [&](const VertexArray& posed) { return reason_of_miss(surface, posed, pose(posed)); };
  EXPECT_THAT(reason(surface.vertices * Eigen::RowVector3d(1, -1, 1).asDiagonal()),
              testing::HasSubstr("a mirror image"));
  EXPECT_THAT(reason(surface.vertices.colwise().reverse()), testing::Not(testing::HasSubstr("ask for more cells")));
  VertexArray spike = surface.vertices;
  spike.row(7) += Eigen::RowVector3d(0, 0, 9);
  const Eigen::RowVector3d place = surface.vertices.row(7);
  EXPECT_THAT(reason(spike), testing::HasSubstr(fmt::format("worst at vertex 7 at ({:.4g}, {:.4g}, {:.4g})", place[0],
                                                            place[1], place[2])));
}

TEST_F(SurfacePoseTest, PosesThatNoBodyTakesAreTold) {
  const auto fault = [&](double x, double y, double z) {
    return fault_of_pose(surface, surface.vertices * Eigen::RowVector3d(x, y, z).asDiagonal());
  };
  EXPECT_THAT(fault(1, -1, 1), testing::HasSubstr("a mirror image"));
  for (const auto& flat :
       {std::array{1.0, 1.0, 0.0}, {1.0, 0.0, 0.0}, {0.0, 0.0, 0.0}, {1.0, 1.0, 1e-4}, {1e-3, 1e-3, 1e-3}})
    EXPECT_THAT(fault(flat[0], flat[1], flat[2]), testing::HasSubstr("times its thickness")) << flat[2];
  EXPECT_EQ(fault(1, -1, -1), "");
  EXPECT_EQ(fault(2, 0.5, 0.3), "");
}

// Positions of a mesh some of whose tets have little left of their volume.
struct VolumeGuardTest : testing::Test {
  TetMesh mesh = test::box_mesh({3, 2, 2}, {3, 2, 2});
  MeshElasticity elasticity = [this] {
    const auto all = [&](double value) { return Eigen::VectorXd::Constant(mesh.tet_count(), value); };
    std::vector<std::int32_t> dofs(static_cast<std::size_t>(3 * mesh.vertex_count()));
    std::iota(dofs.begin(), dofs.end(), 0);
    return MeshElasticity(mesh, {all(1), all(1), all(kPosePoisson), MaterialModel::kStableNeoHookean}, dofs);
  }();
  VolumeGuard guard{mesh, elasticity};
  VertexArray squeezed = [this] {
    VertexArray x = mesh.vertices;
    for (auto point : x.rowwise()) point[0] = point[0] < 1.5 ? 0.15 * point[0] : 2 * point[0];
    for (Eigen::Index i = 0; i < x.size(); ++i) x.reshaped()[i] += 0.02 * std::sin(3.0 * static_cast<double>(i));
    return x;
  }();

  double energy(Eigen::Index vertex, Eigen::Index axis, double by) const {
    VertexArray moved = squeezed;
    moved(vertex, axis) += by;
    return guard.energy(moved);
  }
};

TEST_F(VolumeGuardTest, DerivativesAreThoseOfTheEnergy) {
  Eigen::VectorXd gradient = Eigen::VectorXd::Zero(elasticity.size());
  LowerTriangle hessian = elasticity.pattern();
  const double strength = 3, value = guard.energy(squeezed), h = 1e-5;
  ASSERT_GT(value, 0);
  EXPECT_NEAR(guard.add(squeezed, strength, gradient, hessian), strength * value, 1e-14 * strength * value);
  const double largest = gradient.cwiseAbs().maxCoeff();
  for (Eigen::Index v = 0; v < mesh.vertex_count(); ++v)
    for (Eigen::Index axis = 0; axis < 3; ++axis) {
      const double up = energy(v, axis, h), down = energy(v, axis, -h);
      EXPECT_NEAR(gradient[3 * v + axis], strength * (up - down) / (2 * h), 1e-6 * largest);
    }
}

// Of one tet whose first corner stays: finite differences of the gradient, without their negative eigenvalues.
TEST(VolumeGuardOfATet, HasTheNearestPositiveSemidefiniteStiffness) {
  TetMesh tet = test::box_mesh({1, 1, 1}, {1, 1.5, 2});
  tet.tets = TetArray(tet.tets.topRows(1));
  tet.vertices = VertexArray(tet.vertices(tet.tets.row(0).transpose(), Eigen::all));
  tet.tets.row(0) << 0, 1, 2, 3;
  const Eigen::VectorXd one = Eigen::VectorXd::Ones(1);
  std::vector<std::int32_t> dofs(12);
  std::iota(dofs.begin(), dofs.end(), 0);
  const MeshElasticity elasticity(tet, {one, one, kPosePoisson * one, MaterialModel::kStableNeoHookean}, dofs);
  const VolumeGuard guard(tet, elasticity);
  VertexArray x = tet.vertices * Eigen::RowVector3d(0.3, 0.4, 0.9).asDiagonal();
  x(3, 0) += 0.1;
  const auto slope = [&](const VertexArray& at, LowerTriangle& hessian) -> Eigen::VectorXd {
    Eigen::VectorXd gradient = Eigen::VectorXd::Zero(12);
    hessian = elasticity.pattern();
    guard.add(at, 1, gradient, hessian);
    return gradient.tail<9>();
  };
  LowerTriangle found, other;
  ASSERT_GT(slope(x, found).norm(), 0);
  Eigen::Matrix<double, 9, 9> exact;
  const double h = 1e-6;
  for (Eigen::Index i = 0; i < 9; ++i) {
    VertexArray up = x, down = x;
    up(1 + i / 3, i % 3) += h;
    down(1 + i / 3, i % 3) -= h;
    exact.col(i) = (slope(up, other) - slope(down, other)) / (2 * h);
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, 9, 9>> eigen(exact);
  ASSERT_LT(eigen.eigenvalues().minCoeff(), -0.01 * eigen.eigenvalues().maxCoeff());
  const Eigen::Matrix<double, 9, 9> nearest =
      eigen.eigenvectors() * eigen.eigenvalues().cwiseMax(0).asDiagonal() * eigen.eigenvectors().transpose();
  const Eigen::MatrixXd lower = found;
  const Eigen::MatrixXd whole = lower.selfadjointView<Eigen::Lower>();
  const Eigen::MatrixXd stiffness = whole.bottomRightCorner<9, 9>();
  EXPECT_LT((stiffness - nearest).norm(), 1e-7 * nearest.norm());
}

TEST_F(VolumeGuardTest, IsNothingAboveItsShareAndInfiniteInsideOut) {
  EXPECT_EQ(guard.energy(mesh.vertices * (1.01 * std::cbrt(VolumeGuard::kGuarded))), 0);
  EXPECT_GT(guard.energy(mesh.vertices * (0.99 * std::cbrt(VolumeGuard::kGuarded))), 0);
  EXPECT_EQ(guard.energy(mesh.vertices * Eigen::RowVector3d(1, 1, -1).asDiagonal()), INFINITY);
}

TEST_F(SurfacePoseTest, RefusesPositionsThatAreNotFinite) {
  VertexArray posed = surface.vertices;
  posed(3, 1) = NAN;
  try {
    pose(posed);
    FAIL();
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr("pose: vertices: expected finite numbers"));
  }
}

}  // namespace
}  // namespace exmat::precompute
