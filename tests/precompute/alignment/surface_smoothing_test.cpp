#include "precompute/alignment/surface_smoothing.h"

#include <Eigen/Geometry>
#include <cmath>
#include <gtest/gtest.h>
#include <numbers>

#include "common/mesh/geometry.h"
#include "tests/support/posed_bodies.h"

namespace exmat::precompute {
namespace {

/// Cubes whose middle is within a ball of radius 1, `cells` along a diameter.
TetMesh ball_of_cubes(int cells) {
  const TetMesh box = test::centred(test::box_mesh({cells, cells, cells}, {2, 2, 2}));
  const double edge = 2.0 / cells;
  return test::without(box, [&](const Eigen::RowVector3d& x) {
    const Eigen::RowVector3d middle = edge * ((x / edge).array() + 0.5 * (cells % 2)).floor() +
                                      (0.5 - 0.5 * (cells % 2)) * edge * Eigen::RowVector3d::Ones().array();
    return middle.norm() > 1;
  });
}

double surface_volume(const VertexArray& vertices, const TriangleArray& triangles) {
  double volume = 0;
  for (const auto corners : triangles.rowwise()) {
    const Eigen::Vector3d a = vertices.row(corners[0]), b = vertices.row(corners[1]), c = vertices.row(corners[2]);
    volume += a.dot(b.cross(c)) / 6;
  }
  return volume;
}

TEST(IsStaircase, HoldsOfBodiesOfCubesAlone) {
  const auto holds = [](const TetMesh& mesh) { return is_staircase(mesh.vertices, surface_triangles(mesh.tets)); };
  for (const int cells : {8, 13, 20}) EXPECT_TRUE(holds(ball_of_cubes(cells))) << cells;
  EXPECT_FALSE(holds(test::box_mesh({6, 3, 2}, {4, 1, 1})));
  EXPECT_FALSE(holds(test::cylinder_mesh(10, 6, 4, 0.5, 1)));
  // A box with an arm has right angles inward, but few.
  const TetMesh armed = test::without(test::box_mesh({10, 5, 2}, {4, 2, 0.6}), [](const Eigen::RowVector3d& x) {
    return x[1] > 0.8 && (x[0] < 2.4 || x[0] > 3.2);
  });
  EXPECT_FALSE(holds(armed));
}

TEST(SurfaceSmoothing, LeavesOtherSurfacesAsTheyAre) {
  const TetMesh box = test::box_mesh({6, 3, 2}, {4, 1, 1});
  const SparseMatrix smoothing = surface_smoothing(box.vertices, surface_triangles(box.tets));
  EXPECT_EQ(VertexArray(smoothing * box.vertices), box.vertices);
}

TEST(SurfaceSmoothing, BringsStepsToTheBallTheyAreCutFrom) {
  for (const int cells : {12, 20}) {
    const TetMesh mesh = ball_of_cubes(cells);
    const TriangleArray triangles = surface_triangles(mesh.tets);
    const SparseMatrix smoothing = surface_smoothing(mesh.vertices, triangles);
    const VertexArray smoothed = smoothing * mesh.vertices;
    double before = 0, after = 0, facing = 0;
    for (const auto corners : triangles.rowwise()) {
      Eigen::Matrix3d steps, smooth;
      for (int c = 0; c < 3; ++c) {
        steps.row(c) = mesh.vertices.row(corners[c]);
        smooth.row(c) = smoothed.row(corners[c]);
        before += std::pow(steps.row(c).norm() - 1, 2);
        after += std::pow(smooth.row(c).norm() - 1, 2);
      }
      const Eigen::Vector3d normal =
          (smooth.row(1) - smooth.row(0)).cross(smooth.row(2) - smooth.row(0)).transpose().normalized();
      facing += std::acos(std::clamp(normal.dot(smooth.colwise().mean().normalized().transpose()), -1.0, 1.0));
    }
    EXPECT_LT(after, 0.3 * before) << cells;
    // A step faces 35 degrees off in the mean of a sphere; what is smoothed a third of that.
    EXPECT_LT(facing / static_cast<double>(triangles.rows()), 12 * std::numbers::pi / 180) << cells;
    // The body neither shrinks nor grows: that of the ball, but for half a percent of what the cubes are off.
    const double cubes = surface_volume(mesh.vertices, triangles);
    EXPECT_NEAR(surface_volume(smoothed, triangles), cubes, 0.02 * cubes) << cells;
  }
}

TEST(SurfaceSmoothing, KeepsRigidMotions) {
  const TetMesh mesh = ball_of_cubes(10);
  const SparseMatrix smoothing = surface_smoothing(mesh.vertices, surface_triangles(mesh.tets));
  EXPECT_LT((smoothing * Eigen::VectorXd::Ones(mesh.vertex_count()) - Eigen::VectorXd::Ones(mesh.vertex_count()))
                .cwiseAbs()
                .maxCoeff(),
            1e-13);
}

}  // namespace
}  // namespace exmat::precompute
