#include <gtest/gtest.h>
#include <limits>

#include "common/mesh/geometry.h"
#include "precompute/alignment/kd_tree.h"
#include "precompute/alignment/surface_tree.h"
#include "tests/support/posed_bodies.h"
#include "tests/support/random.h"

namespace exmat::precompute {
namespace {

TEST(KdTree, FindsWhatBruteForceFinds) {
  for (const int dimensions : {3, 6, 20}) {
    const RowMatrix points = test::random_matrix(400, dimensions, 1), queries = test::random_matrix(50, dimensions, 2);
    const KdTree tree{RowMatrix(points)};
    const IndexVector found = tree.nearest(queries);
    for (Eigen::Index k = 0; k < queries.rows(); ++k) {
      const Eigen::VectorXd squared = (points.rowwise() - queries.row(k)).rowwise().squaredNorm();
      Eigen::Index nearest = 0;
      const double least = squared.minCoeff(&nearest);
      EXPECT_EQ(found[k], nearest);
      const auto few = tree.nearest(queries.row(k).data(), 5);
      ASSERT_EQ(few.size(), 5U);
      EXPECT_EQ(few.front(), nearest);
      EXPECT_EQ((squared.array() < squared[few.back()]).count(), 4);
      const double radius = 1.3 * std::sqrt(least);
      EXPECT_EQ(static_cast<Eigen::Index>(tree.within(queries.row(k).data(), radius).size()),
                (squared.array() < radius * radius).count());
    }
    EXPECT_EQ(tree.nearest(queries.row(0).data(), 1000).size(), 400U);
  }
}

// Against a fine sampling of the triangle: nothing on it is nearer, and the point found is on it.
TEST(NearestOnTriangle, NoPointOfTheTriangleIsNearer) {
  constexpr int kSteps = 40;
  for (std::uint32_t seed = 0; seed < 40; ++seed) {
    const Eigen::Matrix3d corners = test::random_matrix(3, 3, 2 * seed);
    const Eigen::Vector3d point = 1.5 * test::random_vector(3, 2 * seed + 1);
    const SurfacePoint found = nearest_on_triangle(corners, point);
    EXPECT_GE(found.weights.minCoeff(), -1e-14);
    EXPECT_NEAR(found.weights.sum(), 1, 1e-14);
    EXPECT_LE((corners.transpose() * found.weights - found.position).norm(), 1e-14);
    double least = std::numeric_limits<double>::infinity();
    for (int i = 0; i <= kSteps; ++i)
      for (int j = 0; i + j <= kSteps; ++j) {
        const Eigen::Vector3d weights(i, j, kSteps - i - j);
        least = std::min(least, (corners.transpose() * weights / kSteps - point).norm());
      }
    EXPECT_LE((found.position - point).norm(), least + 1e-14);
  }
}

TEST(SurfaceTree, FindsWhatAllTrianglesGive) {
  const TetMesh mesh = test::posed(test::centred(test::shaken_box({9, 3, 2}, {4, 1, 0.5}, 3)), test::bend(4, 2));
  const TriangleArray triangles = surface_triangles(mesh.tets);
  const SurfaceTree tree(mesh.vertices, triangles);
  for (std::uint32_t seed = 0; seed < 100; ++seed) {
    const Eigen::Vector3d point = 2 * test::random_vector(3, seed);
    double least = std::numeric_limits<double>::infinity();
    for (Eigen::Index k = 0; k < triangles.rows(); ++k) {
      Eigen::Matrix3d corners;
      for (int c = 0; c < 3; ++c) corners.row(c) = mesh.vertices.row(triangles(k, c));
      least = std::min(least, (nearest_on_triangle(corners, point).position - point).norm());
    }
    EXPECT_EQ((tree.nearest(point).position - point).norm(), least);
  }
}

// A point just above the lower face of a thin plate belongs to that side which faces as it does.
TEST(SurfaceTree, FacingPointsKeepToTheirSideOfAThinPlate) {
  const TetMesh plate = test::box_mesh({8, 8, 1}, {2, 2, 0.02});
  const SurfaceTree tree(plate.vertices, surface_triangles(plate.tets));
  const Eigen::Vector3d point(0.9, 1.1, 0.001), up(0, 0, 1);
  EXPECT_NEAR(tree.nearest(point).position[2], 0, 1e-14);
  EXPECT_NEAR(tree.nearest_facing(point, up).position[2], 0.02, 1e-14);
  EXPECT_NEAR(tree.nearest_facing(point, -up).position[2], 0, 1e-14);
}

TEST(TwoWayChamfer, OfABoxMovedAlongItsNormalIsKnown) {
  const TetMesh box = test::box_mesh({4, 4, 4}, {1, 1, 1});
  const TriangleArray triangles = surface_triangles(box.tets);
  TetMesh moved = box;
  moved.vertices.col(2).array() += 0.01;
  // Two of six faces are 0.01 apart; of the others, samples of the outermost row alone leave by less.
  const double chamfer = two_way_chamfer(SurfaceTree(box.vertices, triangles), SurfaceTree(moved.vertices, triangles));
  EXPECT_NEAR(chamfer, 1e-4 / 3, 1e-9);
  EXPECT_LE(two_way_chamfer(SurfaceTree(box.vertices, triangles), SurfaceTree(box.vertices, triangles)), 1e-30);
}

}  // namespace
}  // namespace exmat::precompute
