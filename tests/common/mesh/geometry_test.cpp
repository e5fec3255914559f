#include "common/mesh/geometry.h"

#include <algorithm>
#include <array>
#include <gtest/gtest.h>
#include <map>

#include "common/core/decompositions.h"
#include "tests/support/box_mesh.h"

namespace exmat {
namespace {

using test::cube_grid;

TetMesh deformed_grid() {
  TetMesh mesh = cube_grid(3, 0.5);
  for (Eigen::Index v = 0; v < mesh.vertex_count(); ++v) {
    const Eigen::Vector3d x = mesh.vertices.row(v);
    mesh.vertices.row(v) += 0.05 * Eigen::RowVector3d(std::sin(3 * x[1]), std::cos(2 * x[2]), std::sin(x[0] + x[1]));
  }
  return mesh;
}

Eigen::RowVector3d area_vector(const TetMesh& mesh, const TriangleArray& triangles, Eigen::Index f) {
  const Eigen::RowVector3d a = mesh.vertices.row(triangles(f, 0));
  const Eigen::RowVector3d b = mesh.vertices.row(triangles(f, 1));
  const Eigen::RowVector3d c = mesh.vertices.row(triangles(f, 2));
  return 0.5 * (b - a).cross(c - a);
}

TEST(TetVolumes, OfTheUnitTetIsASixth) {
  TetMesh mesh;
  mesh.vertices.resize(4, 3);
  mesh.vertices << 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1;
  mesh.tets.resize(2, 4);
  mesh.tets << 0, 1, 2, 3, 0, 1, 3, 2;
  const Eigen::VectorXd volumes = tet_volumes(mesh);
  EXPECT_DOUBLE_EQ(volumes[0], 1.0 / 6.0);
  EXPECT_DOUBLE_EQ(volumes[1], -1.0 / 6.0);
}

TEST(TetVolumes, OfAGridArePositiveAndFillTheCube) {
  const Eigen::VectorXd volumes = tet_volumes(cube_grid(4, 0.5));
  EXPECT_GT(volumes.minCoeff(), 0.0);
  EXPECT_NEAR(volumes.sum(), 8.0, 1e-13);
}

TEST(ShapeGradients, ReproduceLinearFields) {
  const TetMesh mesh = deformed_grid();
  const Eigen::RowVector3d slope(0.7, -1.3, 2.1);
  for (Eigen::Index t = 0; t < mesh.tet_count(); ++t) {
    const auto x = tet_positions(mesh, t);
    const Eigen::Vector4d values = (x * slope.transpose()).array() + 5.0;
    const Eigen::RowVector3d gradient = values.transpose() * shape_gradients(x);
    EXPECT_LT((gradient - slope).norm(), 1e-12) << "tet " << t;
  }
}

TEST(ShapeGradients, SumToZeroAndGiveTheIdentityOfPositions) {
  const TetMesh mesh = deformed_grid();
  for (Eigen::Index t = 0; t < mesh.tet_count(); ++t) {
    const auto x = tet_positions(mesh, t);
    const auto gradients = shape_gradients(x);
    EXPECT_LT(gradients.colwise().sum().norm(), 1e-12);
    const Eigen::Matrix3d deformation_gradient = x.transpose() * gradients;
    EXPECT_LT((deformation_gradient - Eigen::Matrix3d::Identity()).norm(), 1e-12);
  }
}

TEST(Centroid, OfACubeIsItsMiddle) {
  TetMesh mesh = cube_grid(3, 2.0);
  mesh.vertices.rowwise() += Eigen::RowVector3d(1, 2, 3);
  EXPECT_LT((centroid(mesh) - Eigen::Vector3d(4, 5, 6)).norm(), 1e-12);
}

TEST(Centroid, IsWeightedByVolumeNotByTets) {
  TetMesh mesh;
  mesh.vertices.resize(5, 3);
  mesh.vertices << 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, -3;
  mesh.tets.resize(2, 4);
  mesh.tets << 0, 1, 2, 3, 0, 2, 1, 4;
  // The first tet is centred at z = 1/4, the second one, of three times its volume, at -3/4.
  EXPECT_NEAR(centroid(mesh)[2], (0.25 - 3 * 0.75) / 4, 1e-15);
}

TEST(BoundingBoxDiagonal, OfACube) {
  EXPECT_DOUBLE_EQ(bounding_box_diagonal(cube_grid(2, 0.5).vertices), std::sqrt(3.0));
}

TEST(SurfaceTriangles, OfAGridAreTwoPerBoundarySquare) {
  EXPECT_EQ(surface_triangles(cube_grid(1).tets).rows(), 6 * 2);
  EXPECT_EQ(surface_triangles(cube_grid(4).tets).rows(), 6 * 2 * 16);
}

TEST(SurfaceTriangles, AreClosedAndOutward) {
  const TetMesh mesh = deformed_grid();
  const TriangleArray triangles = surface_triangles(mesh.tets);
  Eigen::RowVector3d area = Eigen::RowVector3d::Zero();
  double volume = 0;
  for (Eigen::Index f = 0; f < triangles.rows(); ++f) {
    const Eigen::RowVector3d normal = area_vector(mesh, triangles, f);
    area += normal;
    // Divergence theorem of the field x / 3.
    volume += mesh.vertices.row(triangles(f, 0)).dot(normal) / 3;
  }
  EXPECT_LT(area.norm(), 1e-13);
  EXPECT_NEAR(volume, tet_volumes(mesh).sum(), 1e-13);
}

TEST(SurfaceTriangles, MeetEachEdgeOnceInEachDirection) {
  const TriangleArray triangles = surface_triangles(cube_grid(3).tets);
  std::map<std::array<std::int32_t, 2>, int> edges;
  for (Eigen::Index f = 0; f < triangles.rows(); ++f)
    for (int k = 0; k < 3; ++k) ++edges[{triangles(f, k), triangles(f, (k + 1) % 3)}];
  for (const auto& [edge, count] : edges) {
    EXPECT_EQ(count, 1);
    EXPECT_TRUE(edges.contains({edge[1], edge[0]}));
  }
}

TEST(SurfaceTriangles, OfOneTetAreItsFaces) {
  TetMesh mesh;
  mesh.tets.resize(1, 4);
  mesh.tets << 0, 1, 2, 3;
  EXPECT_EQ(surface_triangles(mesh.tets).rows(), 4);
}

// Single precision has 24 bits: half a unit of the last place at 168 m is 1e-5 m.
TEST(OriginNear, IsZeroUnlessSinglePrecisionWouldMoveTheBody) {
  EXPECT_EQ(origin_near(Eigen::Vector3d(1, -167, 3), 1), Eigen::Vector3d::Zero());
  EXPECT_EQ(origin_near(Eigen::Vector3d(1.2, -168.4, 3), 1), Eigen::Vector3d(1, -168, 3));
  EXPECT_EQ(origin_near(Eigen::Vector3d(1.2, -168.4, 3), 2), Eigen::Vector3d::Zero());
  VertexArray far(2, 3);
  far << 452345.25, 5412345.25, 312, 452346.25, 5412345.75, 312.5;
  EXPECT_EQ(origin_near(far), Eigen::Vector3d(452346, 5412346, 312));
}

}  // namespace
}  // namespace exmat
