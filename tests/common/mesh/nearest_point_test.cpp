#include "common/mesh/nearest_point.h"

#include <gtest/gtest.h>
#include <random>

#include "common/mesh/geometry.h"
#include "tests/support/box_mesh.h"

namespace exmat {
namespace {

VertexArray random_points(int count, double low, double high) {
  std::mt19937 generator(1);
  std::uniform_real_distribution<double> entry(low, high);
  return VertexArray::NullaryExpr(count, 3, [&] { return entry(generator); });
}

// The nearest point of a box is its coordinates clamped: a closed form.
TEST(NearestPoints, OfABoxAreTheClampedPoints) {
  const auto mesh = test::box_mesh({5, 4, 3}, {1.0, 0.8, 0.6});
  const VertexArray points = random_points(400, -0.7, 1.5);
  const auto nearest = nearest_points(mesh, points);
  const Eigen::MatrixXd found = nearest.interpolation(mesh) * mesh.vertices;
  for (Eigen::Index k = 0; k < points.rows(); ++k) {
    const Eigen::RowVector3d exact = points.row(k).cwiseMax(0.0).cwiseMin(Eigen::RowVector3d(1.0, 0.8, 0.6));
    EXPECT_LE((found.row(k) - exact).norm(), 1e-13);
    EXPECT_NEAR(nearest.distances[k], (points.row(k) - exact).norm(), 1e-13);
    EXPECT_GE(nearest.weights.row(k).minCoeff(), 0);
    EXPECT_NEAR(nearest.weights.row(k).sum(), 1, 1e-13);
  }
}

// However far a point is, one of the corners towards it is the nearest: squares of distances are not finite from 1e154
// on.
TEST(NearestPoints, OfPointsBeyondAllSquaresAreCornersOfTheBody) {
  const auto mesh = test::box_mesh({2, 2, 2}, {1.0, 1.0, 1.0});
  for (const double far : {1e20, 1e155, 3e200, 1e308}) {
    VertexArray point(2, 3);
    point << far, far, far, -far, 0.5, 0.5;
    const auto nearest = nearest_points(mesh, point);
    ASSERT_GE(nearest.tets.minCoeff(), 0) << far;
    const Eigen::MatrixXd found = nearest.interpolation(mesh) * mesh.vertices;
    EXPECT_GE(found.row(0).minCoeff(), 0.0) << far;
    EXPECT_LE(found.row(0).maxCoeff(), 1.0) << far;
    EXPECT_GE(nearest.weights.minCoeff(), 0) << far;
  }
}

// Against brute force over a fine sampling of every tet of a body that is not convex.
TEST(NearestPoints, OfANonConvexBodyBeatEverySample) {
  TetMesh mesh = test::box_mesh({4, 4, 1}, {1, 1, 0.25});
  TetArray kept(mesh.tet_count(), 4);
  Eigen::Index count = 0;
  for (Eigen::Index t = 0; t < mesh.tet_count(); ++t) {
    const Eigen::RowVector3d middle = tet_positions(mesh, t).colwise().mean();
    if (middle[0] < 0.5 || middle[1] < 0.5) kept.row(count++) = mesh.tets.row(t);
  }
  mesh.tets = kept.topRows(count);
  const VertexArray points = random_points(60, -0.2, 1.2);
  const auto nearest = nearest_points(mesh, points);
  constexpr int kSteps = 8;
  for (Eigen::Index k = 0; k < points.rows(); ++k) {
    double best = 1e300;
    for (Eigen::Index t = 0; t < mesh.tet_count(); ++t)
      for (int a = 0; a <= kSteps; ++a)
        for (int b = 0; a + b <= kSteps; ++b)
          for (int c = 0; a + b + c <= kSteps; ++c) {
            const Eigen::RowVector4d weights(a, b, c, kSteps - a - b - c);
            best = std::min(best, (weights / kSteps * tet_positions(mesh, t) - points.row(k)).norm());
          }
    EXPECT_LE(nearest.distances[k], best + 1e-13);
    EXPECT_GE(nearest.distances[k], best - 0.05);  // the samples' spacing
  }
}

}  // namespace
}  // namespace exmat
