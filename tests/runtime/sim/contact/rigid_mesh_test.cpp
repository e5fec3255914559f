#include "runtime/sim/contact/rigid_mesh.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <gtest/gtest.h>

#include "runtime/sim/contact/obstacle.h"
#include "tests/support/allocation_counter.h"
#include "tests/support/mesh_distance.h"
#include "tests/support/random.h"
#include "tests/support/surfaces.h"

namespace exmat::runtime {
namespace rigid_mesh_test {

using test::random_vector;

/// A dented ball, none of whose faces is like another.
SurfaceMesh dented_ball() {
  SurfaceMesh ball = test::ball_surface(6, 0.5);
  for (Eigen::Index i = 0; i < ball.vertices.rows(); ++i)
    ball.vertices.row(i) *= 1 + 0.25 * random_vector(1, static_cast<std::uint32_t>(i))[0];
  return ball;
}

SurfaceMesh centred_box(const Eigen::Vector3d& half, const std::array<int, 3>& cells) {
  SurfaceMesh box = test::box_surface(cells, {2 * half[0], 2 * half[1], 2 * half[2]});
  box.vertices.rowwise() -= half.transpose();
  return box;
}

Eigen::Vector3d random_point(int i, double reach) {
  return reach * random_vector(3, static_cast<std::uint32_t>(1000 + i));
}

SurfacePoint nearest(const RigidMesh& mesh, const Eigen::Vector3d& point) { return mesh.nearest(point); }

TEST(RigidMesh, SignedDistanceIsThatOfAllTrianglesAndTheWindingNumber) {
  const SurfaceMesh ball = dented_ball();
  const RigidMesh mesh(ball.vertices, ball.triangles, 0);
  int inside = 0;
  for (int i = 0; i < 1500; ++i) {
    const Eigen::Vector3d point = random_point(i, 0.7);
    const SurfacePoint surface = nearest(mesh, point);
    EXPECT_NEAR(std::abs(surface.distance), test::distance_to_all(ball.vertices, ball.triangles, point), 1e-14);
    EXPECT_EQ(surface.distance<0, test::winding_number(ball.vertices, ball.triangles, point)> 0.5) << i;
    EXPECT_NEAR(surface.normal.norm(), 1, 1e-14);
    EXPECT_LT((surface.point + surface.distance * surface.normal - point).norm(), 1e-14);
    inside += surface.distance < 0;
  }
  EXPECT_GT(inside, 200);
}

TEST(RigidMesh, NormalIsTheGradientOfTheDistance) {
  const SurfaceMesh ball = dented_ball();
  const RigidMesh mesh(ball.vertices, ball.triangles, 0);
  constexpr double kStep = 1e-6;
  int ridges = 0;
  for (int i = 0; i < 500; ++i) {
    const Eigen::Vector3d point = random_point(i, 0.7);
    Eigen::Vector3d gradient;
    for (int axis = 0; axis < 3; ++axis) {
      const Eigen::Vector3d step = kStep * Eigen::Vector3d::Unit(axis);
      gradient[axis] = (nearest(mesh, point + step).distance - nearest(mesh, point - step).distance) / (2 * kStep);
    }
    // Second derivatives are at most 1 over the distance; where two features are as near there is no gradient.
    if ((gradient - nearest(mesh, point).normal).norm() > 1e-4) ++ridges;
  }
  EXPECT_LE(ridges, 2);
}

// A box is the same to rounding: faces, edges and corners, outside and inside.
TEST(RigidMesh, OfABoxIsTheBox) {
  const Eigen::Vector3d half(0.5, 0.2, 0.8);
  const SurfaceMesh surface = centred_box(half, {3, 2, 4});
  const RigidMesh mesh(surface.vertices, surface.triangles, 0);
  const Box box{Eigen::Vector3d::Zero(), half, Eigen::Matrix3d::Identity()};
  for (int i = 0; i < 2000; ++i) {
    const Eigen::Vector3d point = random_point(i, 1.2);
    const SurfacePoint found = nearest(mesh, point), expected = nearest_surface_point(box, point);
    EXPECT_NEAR(found.distance, expected.distance, 1e-14);
    EXPECT_LT((found.normal - expected.normal).norm(), 1e-13) << point.transpose();
  }
}

// The error of a facet is its sagitta, the square of its size.
TEST(RigidMesh, OfASphereConvergesToTheSphere) {
  const Sphere sphere{Eigen::Vector3d::Zero(), 0.5};
  double before = 0;
  for (const int n : {8, 16, 32}) {
    const SurfaceMesh ball = test::ball_surface(n, sphere.radius);
    const RigidMesh mesh(ball.vertices, ball.triangles, 0);
    double error = 0;
    for (int i = 0; i < 400; ++i) {
      const Eigen::Vector3d point = random_point(i, 0.7);
      error = std::max(error, std::abs(nearest(mesh, point).distance - signed_distance(sphere, point)));
    }
    if (before > 0) {
      EXPECT_GT(before / error, 3.5) << n;
    }
    before = error;
  }
  EXPECT_LT(before, 6e-4);
}

TEST(RigidMesh, FacesThatLookInwardMakeARoom) {
  SurfaceMesh surface = centred_box({1, 1, 1}, {2, 2, 2});
  surface.triangles.col(1).swap(surface.triangles.col(2));
  const RigidMesh room(surface.vertices, surface.triangles, 0);
  EXPECT_NEAR(nearest(room, {0, 0, -0.75}).distance, 0.25, 1e-15);
  EXPECT_LT((nearest(room, {0, 0, -0.75}).normal - Eigen::Vector3d::UnitZ()).norm(), 1e-15);
  EXPECT_NEAR(nearest(room, {0, 0, -1.75}).distance, -0.75, 1e-15);
  EXPECT_TRUE(room.may_be_within({0, 0, -5}, 0.1));
  EXPECT_FALSE(room.may_be_within({0, 0, 0}, 0.9));
}

/// One square of 1 m in the plane z = 0, open.
SurfaceMesh sheet(int cells) {
  SurfaceMesh surface;
  surface.vertices.resize((cells + 1) * (cells + 1), 3);
  surface.triangles.resize(2 * cells * cells, 3);
  const auto vertex = [=](int x, int y) { return y * (cells + 1) + x; };
  for (int y = 0; y <= cells; ++y)
    for (int x = 0; x <= cells; ++x)
      surface.vertices.row(vertex(x, y)) << static_cast<double>(x) / cells - 0.5, static_cast<double>(y) / cells - 0.5,
          0;
  int t = 0;
  for (int y = 0; y < cells; ++y)
    for (int x = 0; x < cells; ++x) {
      surface.triangles.row(t++) << vertex(x, y), vertex(x + 1, y), vertex(x + 1, y + 1);
      surface.triangles.row(t++) << vertex(x, y), vertex(x, y + 1),
          vertex(x + 1, y + 1);  // turned: a shell does not mind
    }
  return surface;
}

TEST(RigidMesh, WithAThicknessIsAShellOnBothSides) {
  const SurfaceMesh surface = sheet(5);
  const RigidMesh shell(surface.vertices, surface.triangles, 0.1);
  const Box flat{Eigen::Vector3d::Zero(), {0.5, 0.5, 1e-12}, Eigen::Matrix3d::Identity()};
  for (int i = 0; i < 1000; ++i) {
    const Eigen::Vector3d point = random_point(i, 0.8);
    const SurfacePoint found = nearest(shell, point);
    EXPECT_NEAR(found.distance, signed_distance(flat, point) - 0.05, 2e-12);
    EXPECT_LT((found.point + found.distance * found.normal - point).norm(), 1e-14);
    EXPECT_GE(found.normal.z() * point.z(), -1e-15);
  }
  EXPECT_NEAR(nearest(shell, {0.01, 0.02, 0}).distance, -0.05, 1e-15);
  EXPECT_NEAR(nearest(shell, {0.01, 0.02, 0}).normal.norm(), 1, 1e-15);
}

TEST(RigidMesh, BoundsMissNothingAndHintsChangeNothing) {
  const SurfaceMesh ball = dented_ball(), flat = sheet(4);
  const RigidMesh solid(ball.vertices, ball.triangles, 0), shell(flat.vertices, flat.triangles, 0.2);
  int excluded = 0;
  NearestHint hint;
  for (int i = 0; i < 3000; ++i) {
    const Eigen::Vector3d point = random_point(i, i % 3 == 0 ? 3.0 : 0.8);
    const double radius = 0.3 * std::abs(random_vector(1, static_cast<std::uint32_t>(i))[0]);
    for (const RigidMesh* mesh : {&solid, &shell}) {
      const SurfacePoint surface = nearest(*mesh, point);
      if (surface.distance <= radius) {
        EXPECT_TRUE(mesh->may_be_within(point, radius)) << i;
      }
      excluded += mesh->may_be_within(point, radius) ? 0 : 1;
    }
    for (const double way : {0.0, 1e-4, 1e-2}) {
      const Eigen::Vector3d beside = point + way * random_point(i + 1, 1);
      const SurfacePoint near = solid.nearest(beside, hint), alone = nearest(solid, beside);
      EXPECT_EQ(near.distance, alone.distance);
      EXPECT_EQ(near.normal, alone.normal);
    }
  }
  EXPECT_GT(excluded, 3000);
}

TEST(RigidMesh, QueriesDoNotAllocate) {
  if (!test::AllocationCounter::works()) GTEST_SKIP();
  const SurfaceMesh ball = dented_ball();
  const RigidMesh mesh(ball.vertices, ball.triangles, 0);
  NearestHint hint;
  const test::AllocationCounter allocations;
  mesh.nearest({0.3, 0.2, 0.1}, hint);
  mesh.may_be_within({1, 0, 0}, 0.2);
  EXPECT_EQ(allocations.count(), 0u);
}

}  // namespace rigid_mesh_test
}  // namespace exmat::runtime
