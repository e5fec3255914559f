#include "precompute/posing/surface_pose.h"

#include <Eigen/Geometry>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <numbers>

#include "common/core/error.h"
#include "precompute/posing/surface_springs.h"
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

  SurfacePose pose(const VertexArray& posed) const { return pose_by_surface(cage, surface, embedding, posed, "pose"); }
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
  EXPECT_EQ(found.inverted, 0);
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

class LargePose : public SurfacePoseTest, public testing::WithParamInterface<int> {};
TEST_P(LargePose, Arrives) {
  const std::array<VertexArray, 4> poses = {
      twisted(surface.vertices, std::numbers::pi), bent(surface.vertices, 2 * std::numbers::pi / 3),
      twisted(surface.vertices, 2 * std::numbers::pi), bent(surface.vertices, 1.5 * std::numbers::pi)};
  const SurfacePose found = pose(poses[static_cast<std::size_t>(GetParam())]);
  EXPECT_EQ(found.inverted, 0);
  EXPECT_LT(found.rms, 0.01);
  EXPECT_LT(found.farthest, 0.03);
  EXPECT_GT(tet_volumes({found.positions, cage.tets}).minCoeff(), 0);
}
INSTANTIATE_TEST_SUITE_P(Poses, LargePose, testing::Range(0, 4));

TEST_F(SurfacePoseTest, PosesThatFoldOverThemselvesAreSaidToInvert) {
  VertexArray folded = surface.vertices;
  for (auto point : folded.rowwise())
    if (point[0] > 2) point[0] = 4 - point[0];  // the second half through the first, mirrored
  EXPECT_GT(pose(folded).inverted + static_cast<int>(pose(folded).rms > 0.01), 0);
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
