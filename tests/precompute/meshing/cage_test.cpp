#include "precompute/meshing/cage.h"

#include <Eigen/Geometry>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <numbers>

#include "common/core/error.h"
#include "common/mesh/checks.h"
#include "common/mesh/surface_check.h"
#include "precompute/alignment/surface_tree.h"
#include "precompute/fem/quadratic_tets.h"
#include "precompute/solvers/eigenpairs.h"
#include "tests/support/box_mesh.h"
#include "tests/support/random.h"
#include "tests/support/surfaces.h"

namespace exmat::precompute {
namespace {

using test::ball_surface;
using test::box_surface;
using ::testing::AllOf;
using ::testing::HasSubstr;

// True if a point is in some tet, by the signs of the four volumes that it makes with the faces.
bool is_inside(const TetMesh& mesh, const Eigen::RowVector3d& point) {
  const auto volume = [](const Eigen::RowVector3d& a, const Eigen::RowVector3d& b, const Eigen::RowVector3d& c,
                         const Eigen::RowVector3d& d) { return (b - a).dot(Eigen::RowVector3d((c - a).cross(d - a))); };
  for (const auto& tet : mesh.tets.rowwise()) {
    const Eigen::RowVector3d a = mesh.vertices.row(tet[0]), b = mesh.vertices.row(tet[1]),
                             c = mesh.vertices.row(tet[2]), d = mesh.vertices.row(tet[3]);
    // Rounding of a point that lies on a face.
    const double least = -1e-7 * volume(a, b, c, d);
    if (volume(point, b, c, d) >= least && volume(a, point, c, d) >= least && volume(a, b, point, d) >= least &&
        volume(a, b, c, point) >= least)
      return true;
  }
  return false;
}

// By the normals of the two faces at each edge.
double least_dihedral_angle(const TetMesh& mesh) {
  double least = 180;
  for (const auto& tet : mesh.tets.rowwise())
    for (int i = 0; i < 4; ++i)
      for (int j = i + 1; j < 4; ++j) {
        const auto outward = [&](int without) {
          std::vector<Eigen::Vector3d> face;
          for (int corner = 0; corner < 4; ++corner)
            if (corner != without) face.push_back(mesh.vertices.row(tet[corner]).transpose());
          const Eigen::Vector3d normal = (face[1] - face[0]).cross(face[2] - face[0]).normalized();
          const Eigen::Vector3d inward = mesh.vertices.row(tet[without]).transpose() - face[0];
          return Eigen::Vector3d(normal.dot(inward) > 0 ? -normal : normal);
        };
        const double between = std::acos(std::clamp(outward(i).dot(outward(j)), -1.0, 1.0));
        least = std::min(least, 180 - between * 180 / std::numbers::pi);
      }
  return least;
}

// A tet whose sphere has the cell's radius is 1.6 of it long: nothing of the surface is farther out than half a tet.
constexpr double kOutside = 0.75;

void expect_cage(const Cage& cage, const SurfaceMesh& surface) {
  TetMesh copy = cage.mesh;
  EXPECT_EQ(check_mesh(copy, "cage", {}).reoriented_tets, 0);
  const TriangleArray outer = surface_triangles(cage.mesh.tets);
  for (const auto& corners : surface.triangles.rowwise())
    for (const std::int32_t corner : corners) {
      const Eigen::RowVector3d point = surface.vertices.row(corner);
      if (is_inside(cage.mesh, point)) continue;
      double distance = INFINITY;
      for (const auto& face : outer.rowwise()) {
        Eigen::Matrix3d places;
        for (int k = 0; k < 3; ++k) places.row(k) = cage.mesh.vertices.row(face[k]);
        distance = std::min(distance, (nearest_on_triangle(places, point).position - point.transpose()).norm());
      }
      EXPECT_LE(distance, kOutside * cage.cell_size) << "vertex " << corner;
    }
  const double angle = least_dihedral_angle(cage.mesh);
  EXPECT_GE(angle, kLeastDihedralAngle);
  EXPECT_NEAR(cage.least_angle, angle, 1e-6);
}

// Cells of what is thinner than they are: how far the cage stands off, and so their number, goes in steps.
constexpr double kCountOfThin = 0.2;

// Half of the outside lies without the surface and half within; chords of a coarse one cut off a little more. One that
// encloses a ball has 1.3 times its volume.
constexpr double kVolume = 0.05;

TEST(Cage, FollowsABall) {
  const SurfaceMesh ball = ball_surface(8, 0.5);
  const Cage cage = make_cage(ball, {400, {}}, "ball");
  expect_cage(cage, ball);
  EXPECT_NEAR(static_cast<double>(cage.mesh.tet_count()), 400, 0.3 * 400);
  ASSERT_TRUE(cage.volume_ratio);
  EXPECT_NEAR(*cage.volume_ratio, 1, kVolume);
  EXPECT_NEAR(cage.volume, *cage.volume_ratio * enclosed_volume(ball.vertices, ball.triangles), 1e-12);
  EXPECT_GT(cage.farthest, 0);
  EXPECT_LT(cage.farthest, cage.cell_size / 4);
}

// The distance of a cage's outside from the surface goes with the cell size, as its deviation from the wrap does.
TEST(Cage, FitsCloserTheFinerItIs) {
  const SurfaceMesh ball = ball_surface(12, 1);
  const Cage coarse = make_cage(ball, {{}, 0.2}, "ball"), fine = make_cage(ball, {{}, 0.05}, "ball");
  EXPECT_NEAR(*coarse.volume_ratio, 1, kVolume);
  EXPECT_NEAR(*fine.volume_ratio, 1, kVolume / 2);
  EXPECT_LT(fine.farthest, 0.45 * coarse.farthest);
}

// Lowest frequencies of free bodies, which go with their thickness: of the cage of a bar, and of quadratic tets that
// fill the bar. Corners are cut off, and edges of a bar that is three cells thick.
TEST(Cage, OfABarVibratesAsTheBar) {
  constexpr double kFrequency = 0.05;
  const auto lowest = [](const ElasticSystem& system) {
    const SemidefiniteSolver solver(system.stiffness, system.mass * system.null_space, "bar", system.rigid);
    return smallest_eigenpairs(system.stiffness, system.mass, solver, 4).values.cwiseSqrt().eval();
  };
  const auto materials_of = [](const TetMesh& mesh, Formulation formulation) {
    const Eigen::VectorXd ones = Eigen::VectorXd::Ones(mesh.tet_count());
    return TetMaterials{1e3 * ones,  1e6 * ones,     0.3 * ones, MaterialModel::kStableNeoHookean,
                        formulation, kVarianceFactor};
  };
  const Cage cage = make_cage(box_surface({20, 5, 5}, {4, 1, 1}), {1000, {}}, "bar");
  const TetMesh bar = test::box_mesh({16, 4, 4}, {4, 1, 1});
  const Eigen::VectorXd expected =
      lowest(quadratic_tets(bar, materials_of(bar, Formulation::kLinear), FlagVector::Zero(bar.vertex_count())).system);
  const Eigen::VectorXd found = lowest(build_elastic_system(cage.mesh, materials_of(cage.mesh, Formulation::kSmoothed),
                                                            FlagVector::Zero(cage.mesh.vertex_count())));
  for (Eigen::Index k = 0; k < expected.size(); ++k) EXPECT_NEAR(found[k] / expected[k], 1, kFrequency) << k;
}

TEST(Cage, IsTheSameForTheSameSurface) {
  const SurfaceMesh box = box_surface({6, 3, 3}, {2, 1, 1});
  const Cage first = make_cage(box, {300, {}}, "box"), second = make_cage(box, {300, {}}, "box");
  EXPECT_EQ(first.mesh.vertices, second.mesh.vertices);
  EXPECT_EQ(first.mesh.tets, second.mesh.tets);
}

class CageOfAnySize : public testing::TestWithParam<double> {};
TEST_P(CageOfAnySize, IsThatOfSizeOneScaled) {
  SurfaceMesh box = box_surface({6, 3, 3}, {2, 1, 1});
  const Cage unit = make_cage(box, {300, {}}, "box");
  box.vertices *= GetParam();
  const Cage cage = make_cage(box, {300, {}}, "box");
  expect_cage(cage, box);
  EXPECT_NEAR(static_cast<double>(cage.mesh.tet_count()) / static_cast<double>(unit.mesh.tet_count()), 1, 0.1);
  EXPECT_NEAR(*cage.volume_ratio, *unit.volume_ratio, 0.05);
}
INSTANTIATE_TEST_SUITE_P(Sizes, CageOfAnySize, testing::Values(1e-6, 1e6));

TEST(Cage, FollowsSurfacesThatAreNotClosed) {
  SurfaceMesh open = ball_surface(8, 1);
  open.triangles.conservativeResize(open.triangles.rows() - 60, Eigen::NoChange);
  const Cage cage = make_cage(open, {500, {}}, "open");
  expect_cage(cage, open);
  EXPECT_FALSE(cage.volume_ratio);
}

TEST(Cage, FollowsSoupsOfFlippedAndDoubledTriangles) {
  const SurfaceMesh ball = ball_surface(6, 1);
  SurfaceMesh soup;
  const Eigen::Index n = ball.triangles.rows();
  soup.vertices.resize(6 * n, 3);
  soup.triangles.resize(2 * n, 3);
  for (Eigen::Index t = 0; t < 2 * n; ++t)
    for (int corner = 0; corner < 3; ++corner) {
      const auto vertex = static_cast<std::int32_t>(3 * t + corner);
      soup.vertices.row(vertex) = ball.vertices.row(ball.triangles(t % n, corner));
      soup.triangles(t, t % 3 == 0 ? 2 - corner : corner) = vertex;
    }
  expect_cage(make_cage(soup, {500, {}}, "soup"), soup);
}

TEST(Cage, FollowsSurfacesThatCrossThemselves) {
  SurfaceMesh other = ball_surface(6, 0.6);
  other.vertices.col(0).array() += 0.9;
  const SurfaceMesh crossing = test::together(ball_surface(6, 0.7), other);
  expect_cage(make_cage(crossing, {800, {}}, "crossing"), crossing);
}

TEST(Cage, StandsOffASheetThinnerThanACell) {
  const SurfaceMesh sheet = box_surface({12, 8, 1}, {1, 0.7, 0.001});
  const Cage cage = make_cage(sheet, {1500, {}}, "sheet");
  expect_cage(cage, sheet);
  EXPECT_NEAR(static_cast<double>(cage.mesh.tet_count()), 1500, kCountOfThin * 1500);
}

// Two ends that a rod of a hundredth of their thickness joins: rays from the middle meet the rod alone or an end, and a
// cage that follows the rod closely falls apart.
// A plate and a rod that are thinner than a cell; as many cells as are advised follow them.
TEST(Cage, SaysHowManyCellsFollowAThinSurface) {
  for (const Eigen::Vector3d& lengths : {Eigen::Vector3d(1, 1, 0.05), Eigen::Vector3d(1, 0.04, 0.04)}) {
    const SurfaceMesh thin = box_surface({10, 4, 2}, {lengths[0], lengths[1], lengths[2]});
    const Cage coarse = make_cage(thin, {.cells = 400}, "thin");
    EXPECT_GT(*coarse.volume_ratio, 1.2);
    const auto cells = cells_that_follow(thin, coarse);
    ASSERT_TRUE(cells);
    const Cage fine = make_cage(thin, {.cells = static_cast<int>(*cells)}, "thin");
    EXPECT_LE(*fine.volume_ratio, 1.15) << *cells << " cells";
    EXPECT_FALSE(cells_that_follow(thin, fine));
  }
}

TEST(Cage, OfWhatHangsTogetherIsOneBody) {
  SurfaceMesh surface = box_surface({32, 4, 4}, {4, 1, 1});
  for (auto point : surface.vertices.rowwise()) {
    const double thickness = point[0] < 1 || point[0] > 3 ? 1 : 0.01;
    for (int axis : {1, 2}) point[axis] = thickness * (point[axis] - 0.5);
  }
  const Cage cage = make_cage(surface, {300, {}}, "dumbbell");
  expect_cage(cage, surface);
  EXPECT_NEAR(static_cast<double>(cage.mesh.tet_count()), 300, kCountOfThin * 300);
}

// A flag stands in a cube without a vertex in common: tets that follow it closely fall apart.
TEST(Cage, OfPartsThatCrossIsOneBody) {
  SurfaceMesh flag = box_surface({12, 1, 8}, {2, 0.0001, 0.8});
  flag.vertices.rowwise() += Eigen::RowVector3d(0.9, 0.5, 0.1);
  const SurfaceMesh parts = test::together(box_surface({8, 8, 8}, {1, 1, 1}), flag);
  expect_cage(make_cage(parts, {2000, {}}, "flag"), parts);
}

TEST(Cage, IgnoresTrianglesWithoutAreaAndVerticesWithoutTriangles) {
  SurfaceMesh ball = ball_surface(6, 1);
  const Eigen::Index n = ball.vertices.rows();
  ball.vertices.conservativeResize(n + 1, Eigen::NoChange);
  ball.vertices.row(n) << 3, 0, 0;
  ball.triangles.conservativeResize(ball.triangles.rows() + 1, Eigen::NoChange);
  ball.triangles.bottomRows(1) << 5, 5, 7;
  const Cage cage = make_cage(ball, {{}, 0.5}, "ball");
  EXPECT_FALSE(is_inside(cage.mesh, ball.vertices.row(n)));
}

std::string refusal(const SurfaceMesh& surface, const CageSettings& settings) {
  try {
    make_cage(surface, settings, "s.obj");
  } catch (const InputError& error) {
    return error.what();
  }
  return "none";
}

TEST(Cage, RefusesSeveralBodies) {
  SurfaceMesh other = ball_surface(6, 1);
  other.vertices.col(0).array() += 6;
  EXPECT_THAT(
      refusal(test::together(ball_surface(6, 1), other), {500, {}}),
      AllOf(HasSubstr("s.obj: the tets that fill the surface"), HasSubstr("component"), HasSubstr("join the parts")));
}

TEST(Cage, RefusesSurfacesWithoutAnExtent) {
  SurfaceMesh none = ball_surface(4, 1);
  none.triangles.col(1) = none.triangles.col(0);
  EXPECT_THAT(refusal(none, {}), HasSubstr("s.obj: expected a surface: triangles that have an area"));
  for (const double extent : {0.0, 1e-200, 1e308}) {
    SurfaceMesh ball = ball_surface(4, 1);
    ball.vertices *= extent;
    EXPECT_THAT(refusal(ball, {}),
                AllOf(HasSubstr("s.obj: vertices: expected a longest edge of the bounding box from "),
                      HasSubstr("object.unit or object.scale")))
        << extent;
  }
}

TEST(Cage, RefusesCellsThatAreNoSizeForIt) {
  EXPECT_THAT(refusal(ball_surface(6, 1), {{}, 50.0}),
              AllOf(HasSubstr("s.obj: cell size: expected 0.00693 to 1.73 m"), HasSubstr("found 50 m")));
}

}  // namespace
}  // namespace exmat::precompute
