#include "runtime/sim/contact/nearest_on_triangle.h"

#include <Eigen/Geometry>
#include <gtest/gtest.h>
#include <random>

namespace exmat::runtime {
namespace {

/// The nearest of the plane's point, if inside, and the edges': another way to the same.
double distance_by_parts(const Eigen::Vector3d& p, const Eigen::Matrix3d& corners) {
  double nearest = std::numeric_limits<double>::infinity();
  for (int c = 0; c < 3; ++c) {
    const Eigen::Vector3d a = corners.col(c), edge = corners.col((c + 1) % 3) - a;
    const double along = std::clamp(edge.dot(p - a) / edge.squaredNorm(), 0.0, 1.0);
    nearest = std::min(nearest, (a + along * edge - p).norm());
  }
  const Eigen::Vector3d normal = (corners.col(1) - corners.col(0)).cross(corners.col(2) - corners.col(0)).normalized();
  const Eigen::Vector3d foot = p - normal.dot(p - corners.col(0)) * normal;
  Eigen::Matrix3d system;
  system << corners.col(1) - corners.col(0), corners.col(2) - corners.col(0), normal;
  const Eigen::Vector3d w = system.inverse() * (foot - corners.col(0));
  if (w[0] >= 0 && w[1] >= 0 && w[0] + w[1] <= 1) nearest = std::min(nearest, (foot - p).norm());
  return nearest;
}

TEST(NearestOnTriangle, IsTheNearestOfFaceAndEdges) {
  std::mt19937 random(3);
  std::normal_distribution<double> normal;
  const auto point = [&] { return Eigen::Vector3d(normal(random), normal(random), normal(random)); };
  for (int i = 0; i < 2000; ++i) {
    Eigen::Matrix3d corners;
    corners << point(), point(), point();
    const Eigen::Vector3d p = 2 * point();
    const TrianglePoint found = nearest_on_triangle(p, corners.col(0), corners.col(1), corners.col(2));
    EXPECT_NEAR(std::sqrt(found.squared_distance), distance_by_parts(p, corners), 1e-12);
    EXPECT_NEAR((corners * found.barycentric - found.point).norm(), 0, 1e-12);
    EXPECT_GE(found.barycentric.minCoeff(), 0);
    EXPECT_NEAR(found.barycentric.sum(), 1, 1e-14);
  }
}

TEST(NearestOnTriangle, OfNoAreaIsOnIt) {
  const Eigen::Vector3d a(0, 0, 0), b(1, 0, 0);
  const TrianglePoint found = nearest_on_triangle({0.25, 1, 0}, a, b, 0.5 * (a + b));
  EXPECT_TRUE(found.point.allFinite());
  EXPECT_NEAR(found.point[1], 0, 0);
  EXPECT_GE(found.squared_distance, 1);
}

// Two corners in one place, whichever they are, leave an edge; three of them a point.
TEST(NearestOnTriangle, OfCornersInOnePlaceIsOnTheEdge) {
  std::mt19937 random(4);
  std::normal_distribution<double> normal;
  const auto point = [&] { return Eigen::Vector3d(normal(random), normal(random), normal(random)); };
  for (int i = 0; i < 1000; ++i) {
    const Eigen::Vector3d a = point(), b = point(), p = 3 * point();
    const double along = std::clamp((b - a).dot(p - a) / (b - a).squaredNorm(), 0.0, 1.0);
    const double expected = (a + along * (b - a) - p).norm();
    for (const TrianglePoint& found :
         {nearest_on_triangle(p, a, a, b), nearest_on_triangle(p, a, b, a), nearest_on_triangle(p, a, b, b)}) {
      EXPECT_NEAR(std::sqrt(found.squared_distance), expected, 1e-12);
      EXPECT_NEAR((found.point - p).norm(), expected, 1e-12);
    }
    EXPECT_EQ(nearest_on_triangle(p, a, a, a).point, a);
  }
}

}  // namespace
}  // namespace exmat::runtime
