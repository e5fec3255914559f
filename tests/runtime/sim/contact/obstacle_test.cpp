#include "runtime/sim/contact/obstacle.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <gtest/gtest.h>
#include <numbers>

#include "tests/support/named_shapes.h"
#include "tests/support/random.h"

namespace exmat::runtime {
namespace obstacle_test {

using test::kBox;
using test::kCapsule;
using test::kPlane;
using test::kSphere;
using test::kTurn;
using test::NamedShape;
using test::random_vector;

class EachShape : public ::testing::TestWithParam<NamedShape> {};
INSTANTIATE_TEST_SUITE_P(Shapes, EachShape,
                         ::testing::Values(NamedShape{"plane", kPlane}, NamedShape{"sphere", kSphere},
                                           NamedShape{"box", kBox}, NamedShape{"capsule", kCapsule}),
                         [](const auto& shape) { return shape.param.name; });

Eigen::Vector3d random_point(int i) { return 1.5 * random_vector(3, static_cast<std::uint32_t>(i)); }

TEST_P(EachShape, HasItsGradientForANormal) {
  constexpr double kStep = 1e-6;
  for (int i = 0; i < 300; ++i) {
    const Eigen::Vector3d point = random_point(i);
    const SurfacePoint surface = nearest_surface_point(GetParam().shape, point);
    Eigen::Vector3d gradient;
    for (int axis = 0; axis < 3; ++axis) {
      const Eigen::Vector3d step = kStep * Eigen::Vector3d::Unit(axis);
      gradient[axis] =
          (signed_distance(GetParam().shape, point + step) - signed_distance(GetParam().shape, point - step)) /
          (2 * kStep);
    }
    EXPECT_NEAR(surface.normal.norm(), 1, 1e-14);
    EXPECT_LT((gradient - surface.normal).norm(), 1e-5) << i;
  }
}

TEST_P(EachShape, LeadsToItsSurfaceAlongTheNormal) {
  for (int i = 0; i < 300; ++i) {
    const Eigen::Vector3d point = random_point(i);
    const SurfacePoint surface = nearest_surface_point(GetParam().shape, point);
    EXPECT_EQ(surface.distance, signed_distance(GetParam().shape, point));
    EXPECT_LT((surface.point + surface.distance * surface.normal - point).norm(), 1e-14);
    EXPECT_NEAR(signed_distance(GetParam().shape, surface.point), 0, 1e-14);
  }
}

TEST_P(EachShape, IsNoNearerToABallThanItsCentreLessTheRadius) {
  for (int i = 0; i < 300; ++i) {
    const Eigen::Vector3d a = random_point(2 * i), b = random_point(2 * i + 1);
    EXPECT_GE(signed_distance(GetParam().shape, b),
              signed_distance(GetParam().shape, a) - (a - b).norm() * (1 + 1e-14));
  }
}

/// Distance of the nearest of a cloud of surface points.
double sampled_distance(const std::vector<Eigen::Vector3d>& cloud, const Eigen::Vector3d& point) {
  double nearest = 1e9;
  for (const Eigen::Vector3d& sample : cloud) nearest = std::min(nearest, (sample - point).norm());
  return nearest;
}

std::vector<Eigen::Vector3d> box_cloud(int count) {
  std::vector<Eigen::Vector3d> cloud;
  for (int axis = 0; axis < 3; ++axis)
    for (const double side : {-1.0, 1.0})
      for (int i = 0; i <= count; ++i)
        for (int j = 0; j <= count; ++j) {
          Eigen::Vector3d unit;
          unit[axis] = side;
          unit[(axis + 1) % 3] = 2.0 * i / count - 1;
          unit[(axis + 2) % 3] = 2.0 * j / count - 1;
          cloud.push_back(kBox.centre + kTurn * kBox.half_extents.cwiseProduct(unit));
        }
  return cloud;
}

std::vector<Eigen::Vector3d> capsule_cloud(int count) {
  std::vector<Eigen::Vector3d> cloud;
  const Eigen::Vector3d axis = (kCapsule.end - kCapsule.start).normalized(), side = axis.unitOrthogonal();
  for (int i = 0; i <= count; ++i)
    for (int j = 0; j < count; ++j) {
      const double angle = 2 * std::numbers::pi * j / count, tilt = std::numbers::pi * (i - count / 2.0) / count;
      const Eigen::Vector3d around = std::cos(angle) * side + std::sin(angle) * axis.cross(side);
      const double along = static_cast<double>(i) / count;
      cloud.push_back(kCapsule.start + along * (kCapsule.end - kCapsule.start) + kCapsule.radius * around);
      const Eigen::Vector3d end = tilt < 0 ? kCapsule.start : kCapsule.end;
      cloud.push_back(end + kCapsule.radius * (std::cos(tilt) * around + std::sin(tilt) * axis));
    }
  return cloud;
}

TEST(Obstacle, HasTheDistanceToItsNearestSurfacePointByBruteForce) {
  const std::vector<Eigen::Vector3d> box = box_cloud(100), capsule = capsule_cloud(160);
  for (int i = 0; i < 60; ++i) {
    const Eigen::Vector3d point = random_point(i);
    EXPECT_NEAR(std::abs(signed_distance(kBox, point)), sampled_distance(box, point), 6e-3) << i;
    EXPECT_NEAR(std::abs(signed_distance(kCapsule, point)), sampled_distance(capsule, point), 6e-3) << i;
    const Eigen::Vector3d local = kTurn.transpose() * (point - kBox.centre);
    EXPECT_EQ(signed_distance(kBox, point) < 0, (local.cwiseAbs().array() < kBox.half_extents.array()).all());
  }
}

TEST(Obstacle, HasClosedFormDistances) {
  EXPECT_NEAR(signed_distance(kPlane, kPlane.point - 0.4 * kPlane.normal + kPlane.normal.unitOrthogonal()), -0.4,
              1e-15);
  EXPECT_NEAR(signed_distance(kSphere, kSphere.centre), -0.6, 1e-15);
  EXPECT_NEAR(signed_distance(kSphere, kSphere.centre + Eigen::Vector3d(0, 2, 0)), 1.4, 1e-15);
  const Box cube{{0, 0, 0}, {1, 2, 3}, Eigen::Matrix3d::Identity()};
  EXPECT_NEAR(signed_distance(cube, {2, 4, 5}), 3, 1e-15);  // corner: (1, 2, 2)
  EXPECT_NEAR(signed_distance(cube, {0.75, 0, 0}), -0.25, 1e-15);
  EXPECT_NEAR(signed_distance(kCapsule, 0.5 * (kCapsule.start + kCapsule.end)), -0.25, 1e-15);
}

TEST(Obstacle, HasAUnitNormalWhereTheDistanceHasNoGradient) {
  const Box cube{{0, 0, 0}, {1, 1, 1}, Eigen::Matrix3d::Identity()};
  const Capsule point_like{{1, 1, 1}, {1, 1, 1}, 0.5};
  const std::pair<Shape, Eigen::Vector3d> cases[] = {
      {kSphere, kSphere.centre}, {kCapsule, kCapsule.start}, {kBox, kBox.centre},    {cube, {0, 0, 0}},
      {cube, {0.5, -0.5, 0}},    {cube, {1, 1, 1}},          {point_like, {1, 1, 1}}};
  for (const auto& [shape, point] : cases) {
    const SurfacePoint surface = nearest_surface_point(shape, point);
    EXPECT_NEAR(surface.normal.norm(), 1, 1e-15);
    EXPECT_NEAR(signed_distance(shape, surface.point), 0, 1e-15);
    EXPECT_EQ(surface.normal, nearest_surface_point(shape, point).normal);
  }
}

TEST(Obstacle, IsPlacedByItsMotion) {
  const Obstacle obstacle{kBox, RigidMotion({{0, {1, 2, 3}, Eigen::Quaterniond(kTurn)}}), 1, 0, 0};
  const PlacedObstacle placed(obstacle, 7, 0.1);
  const Eigen::Vector3d point(0.4, 0.1, 0.9), world = kTurn * point + Eigen::Vector3d(1, 2, 3);
  EXPECT_NEAR(placed.signed_distance(world), signed_distance(kBox, point), 1e-14);
  EXPECT_LT((placed.nearest_surface_point(world).normal - kTurn * nearest_surface_point(kBox, point).normal).norm(),
            1e-14);
}

}  // namespace obstacle_test
}  // namespace exmat::runtime
