#include "precompute/render/embedding.h"

#include <gtest/gtest.h>
#include <limits>
#include <random>

#include "common/core/decompositions.h"
#include "common/mesh/assembly.h"
#include "common/mesh/geometry.h"
#include "precompute/alignment/surface_tree.h"
#include "tests/support/posed_bodies.h"

namespace exmat::precompute {
namespace {

TetMesh body() { return test::shaken_box({5, 3, 2}, {2, 1, 0.6}, 3); }

// In the box that is twice the body's.
VertexArray scattered_points(Eigen::Index count) {
  std::mt19937 generator(11);
  std::uniform_real_distribution<double> unit(-0.5, 1.5);
  VertexArray points(count, 3);
  for (auto x : points.rowwise()) x << 2 * unit(generator), unit(generator), 0.6 * unit(generator);
  return points;
}

// The least coordinate of a point in a tet, by a linear solve; 0 on its surface.
double least_coordinate(const TetMesh& mesh, Eigen::Index tet, const Eigen::RowVector3d& point) {
  Eigen::Matrix4d system;
  system << tet_positions(mesh, tet).transpose(), Eigen::RowVector4d::Ones();
  return system.fullPivLu().solve(Eigen::Vector4d(point[0], point[1], point[2], 1)).minCoeff();
}

TEST(EmbedPoints, TakesTheTetThatHoldsAPointOrIsNearest) {
  const TetMesh mesh = body();
  const VertexArray points = scattered_points(300);
  const Embedding embedding = embed_points(mesh, points, "test");
  const TriangleArray surface = surface_triangles(mesh.tets);
  Eigen::Index outside = 0;
  double farthest = 0;
  for (Eigen::Index k = 0; k < points.rows(); ++k) {
    double most = -std::numeric_limits<double>::infinity(), distance = std::numeric_limits<double>::infinity();
    for (Eigen::Index t = 0; t < mesh.tet_count(); ++t) most = std::max(most, least_coordinate(mesh, t, points.row(k)));
    const Eigen::Vector3d point = points.row(k);
    for (const auto& triangle : surface.rowwise()) {
      Eigen::Matrix3d corners;
      for (int c = 0; c < 3; ++c) corners.row(c) = mesh.vertices.row(triangle[c]);
      distance = std::min(distance, (nearest_on_triangle(corners, point).position - point).norm());
    }
    const Eigen::Index tet = embedding.points.tets[k];
    if (most >= 0) {
      EXPECT_GE(least_coordinate(mesh, tet, points.row(k)), -1e-12);
      EXPECT_EQ(embedding.points.distances[k], 0);
      continue;
    }
    ++outside;
    farthest = std::max(farthest, distance);
    // One of the tet's own faces is at that distance.
    const TriangleArray faces = surface_triangles(mesh.tets.row(tet));
    double own = std::numeric_limits<double>::infinity();
    for (const auto& triangle : faces.rowwise()) {
      Eigen::Matrix3d corners;
      for (int c = 0; c < 3; ++c) corners.row(c) = mesh.vertices.row(triangle[c]);
      own = std::min(own, (nearest_on_triangle(corners, point).position - point).norm());
    }
    EXPECT_NEAR(own, distance, 1e-12);
    EXPECT_NEAR(embedding.points.distances[k], distance, 1e-12);
  }
  EXPECT_GT(outside, 100);
  EXPECT_LT(outside, 290);
  EXPECT_EQ(embedding.outside, outside);
  EXPECT_NEAR(embedding.farthest, farthest, 1e-12);
}

// Exact for affine motions, inside and outside; 1e-12 is rounding.
TEST(EmbedPoints, PointsFollowAffineMotions) {
  const TetMesh mesh = body();
  const VertexArray points = scattered_points(100);
  const SparseMatrix interpolation = embed_points(mesh, points, "test").points.interpolation(mesh);
  EXPECT_LE((interpolation * mesh.vertices - points).norm(), 1e-12);
  Eigen::Matrix3d F;
  F << 1.2, 0.3, 0, -0.1, 0.9, 0.2, 0, 0.4, 1.1;
  const auto moved = [&](const VertexArray& x) {
    return VertexArray((x * F.transpose()).rowwise() + Eigen::RowVector3d(1, -2, 3));
  };
  EXPECT_LE((interpolation * moved(mesh.vertices) - moved(points)).norm(), 1e-12);
}

TEST(EmbedPoints, PointsOnTheBodyAreNotOutside) {
  const TetMesh mesh = body();
  const Embedding embedding = embed_points(mesh, mesh.vertices, "test");
  EXPECT_EQ(embedding.outside, 0);
  EXPECT_LE(embedding.farthest, 1e-12);
  EXPECT_EQ(embed_points(mesh, VertexArray(0, 3), "test").outside, 0);
}

}  // namespace
}  // namespace exmat::precompute
