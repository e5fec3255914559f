#include "runtime/sim/contact/height_field.h"

#include <Eigen/Geometry>
#include <cmath>
#include <gtest/gtest.h>

#include "tests/support/allocation_counter.h"
#include "tests/support/mesh_distance.h"
#include "tests/support/random.h"

namespace exmat::runtime {
namespace {

using test::random_vector;

const Eigen::Vector2d kSpacing(0.1, 0.15);

/// Hills of 7 x 11 points.
RowMatrix hills() {
  RowMatrix heights(11, 7);
  heights.reshaped() = 0.12 * random_vector(77, 3);
  return heights;
}

/// Its triangles, written out.
void triangulate(const RowMatrix& heights, VertexArray& vertices, TriangleArray& triangles) {
  const auto columns = static_cast<int>(heights.cols()), rows = static_cast<int>(heights.rows());
  vertices.resize(columns * rows, 3);
  triangles.resize(2 * (columns - 1) * (rows - 1), 3);
  for (int y = 0; y < rows; ++y)
    for (int x = 0; x < columns; ++x) vertices.row(y * columns + x) << x * kSpacing[0], y * kSpacing[1], heights(y, x);
  int t = 0;
  for (int y = 0; y + 1 < rows; ++y)
    for (int x = 0; x + 1 < columns; ++x) {
      const int at = y * columns + x;
      triangles.row(t++) << at, at + 1, at + columns + 1;
      triangles.row(t++) << at, at + columns + 1, at + columns;
    }
}

/// Above the area and around it.
Eigen::Vector3d random_point(int i) {
  const Eigen::Vector3d unit = random_vector(3, static_cast<std::uint32_t>(500 + i));
  return {0.3 + 0.5 * unit[0], 0.75 + unit[1], 0.4 * unit[2]};
}

/// True if a ray upward meets a triangle.
bool is_below(const VertexArray& x, const TriangleArray& triangles, const Eigen::Vector3d& point) {
  for (Eigen::Index t = 0; t < triangles.rows(); ++t) {
    const Eigen::Vector3d a = x.row(triangles(t, 0)), b = x.row(triangles(t, 1)), c = x.row(triangles(t, 2));
    const auto side = [&](const Eigen::Vector3d& from, const Eigen::Vector3d& to) {
      return (to - from).head<2>().x() * (point - from).y() - (to - from).y() * (point - from).x();
    };
    if (side(a, b) < 0 || side(b, c) < 0 || side(c, a) < 0) continue;
    return (b - a).cross(c - a).dot(point - a) < 0;
  }
  return false;
}

TEST(HeightField, SignedDistanceIsThatOfAllTrianglesAndWhatIsBelow) {
  VertexArray vertices;
  TriangleArray triangles;
  triangulate(hills(), vertices, triangles);
  const HeightField field(hills(), kSpacing);
  int below = 0;
  NearestHint hint;
  for (int i = 0; i < 2000; ++i) {
    const Eigen::Vector3d point = random_point(i);
    const SurfacePoint surface = field.nearest(point);
    for (const double way : {0.0, 1e-4, 1e-2}) {
      const Eigen::Vector3d beside = point + way * random_vector(3, 7);
      EXPECT_EQ(field.nearest(beside, hint).distance, field.nearest(beside).distance);
    }
    EXPECT_NEAR(std::abs(surface.distance), test::distance_to_all(vertices, triangles, point), 1e-14);
    EXPECT_EQ(surface.distance < 0, is_below(vertices, triangles, point)) << i;
    EXPECT_NEAR(surface.normal.norm(), 1, 1e-14);
    EXPECT_LT((surface.point + surface.distance * surface.normal - point).norm(), 1e-13) << point.transpose();
    below += surface.distance < 0;
  }
  EXPECT_GT(below, 200);
}

TEST(HeightField, OfASlopeIsThePlane) {
  const double slope = 0.3;
  RowMatrix heights(20, 30);
  for (int y = 0; y < 20; ++y)
    for (int x = 0; x < 30; ++x) heights(y, x) = slope * x * kSpacing[0] + 2;
  const HeightField field(heights, kSpacing);
  const Eigen::Vector3d normal = Eigen::Vector3d(-slope, 0, 1).normalized();
  for (int i = 0; i < 200; ++i) {
    const Eigen::Vector3d unit = random_vector(3, static_cast<std::uint32_t>(i));
    const Eigen::Vector3d point(1.45 + unit[0], 1.4 + unit[1], 2 + slope * (1.45 + unit[0]) + 0.2 * unit[2]);
    const SurfacePoint surface = field.nearest(point);
    EXPECT_NEAR(surface.distance, normal.dot(point - Eigen::Vector3d(0, 0, 2)), 1e-13);
    EXPECT_LT((surface.normal - normal).norm(), 1e-12);
    EXPECT_NEAR(field.height_at(point[0], point[1]), 2 + slope * point[0], 1e-13);
  }
}

TEST(HeightField, BoundsMissNothing) {
  const HeightField field(hills(), kSpacing);
  int excluded = 0;
  for (int i = 0; i < 2000; ++i) {
    const Eigen::Vector3d point = random_point(i);
    const double radius = 0.2 * std::abs(random_vector(1, static_cast<std::uint32_t>(i))[0]);
    if (field.nearest(point).distance <= radius) {
      EXPECT_TRUE(field.may_be_within(point, radius)) << i;
    } else {
      EXPECT_FALSE(field.may_be_within(point, radius)) << i;
      ++excluded;
    }
  }
  EXPECT_GT(excluded, 500);
}

TEST(HeightField, QueriesDoNotAllocate) {
  if (!test::AllocationCounter::works()) GTEST_SKIP();
  const HeightField field(hills(), kSpacing);
  const test::AllocationCounter allocations;
  field.nearest({0.3, 0.2, 0.1});
  field.may_be_within({1, 0, 0}, 0.2);
  EXPECT_EQ(allocations.count(), 0u);
}

}  // namespace
}  // namespace exmat::runtime
