#include "runtime/sim/contact/ray.h"

#include <Eigen/Geometry>
#include <gtest/gtest.h>
#include <memory>

#include "runtime/sim/contact/obstacle.h"
#include "tests/support/named_shapes.h"
#include "tests/support/random.h"
#include "tests/support/surfaces.h"

namespace exmat::runtime {
namespace ray_test {

using test::kBox;
using test::kCapsule;
using test::kPlane;
using test::kSphere;
using test::kTurn;
using test::NamedShape;
using test::random_vector;

/// A dented ball: closed without a thickness, else a shell that lacks some triangles.
MeshShape dented_ball(double thickness) {
  SurfaceMesh ball = test::ball_surface(6, 0.8);
  for (Eigen::Index i = 0; i < ball.vertices.rows(); ++i)
    ball.vertices.row(i) *= 1 + 0.25 * random_vector(1, static_cast<std::uint32_t>(i))[0];
  const Eigen::Index kept = thickness > 0 ? ball.triangles.rows() / 2 : ball.triangles.rows();
  const TriangleArray triangles = ball.triangles.topRows(kept);
  return {std::make_shared<RigidMesh>(ball.vertices, triangles, thickness), {0.1, 0.2, -0.1}, kTurn};
}

HeightFieldShape ground() {
  RowMatrix heights(9, 12);
  for (Eigen::Index i = 0; i < heights.size(); ++i)
    heights.data()[i] = 0.3 * random_vector(1, static_cast<std::uint32_t>(i))[0];
  return {std::make_shared<HeightField>(heights, Eigen::Vector2d(0.2, 0.25)), {-1, -1, 0.1}, kTurn};
}

class RayInto : public ::testing::TestWithParam<NamedShape> {};
INSTANTIATE_TEST_SUITE_P(Shapes, RayInto,
                         ::testing::Values(NamedShape{"plane", kPlane}, NamedShape{"sphere", kSphere},
                                           NamedShape{"box", kBox}, NamedShape{"capsule", kCapsule},
                                           NamedShape{"mesh", dented_ball(0)}, NamedShape{"shell", dented_ball(0.15)},
                                           NamedShape{"ground", ground()}),
                         [](const auto& shape) { return shape.param.name; });

// By signed distances, which other tests hold against their definitions: the ray enters where the distance becomes 0,
// and before that, or all along a ray that misses, it is not negative.
TEST_P(RayInto, EndsWhereTheDistanceIsZeroFirst) {
  constexpr double kReach = 6, kRounding = 1e-12;
  constexpr int kSamples = 100;
  const Shape& shape = GetParam().shape;
  int hits = 0, misses = 0, inside = 0;
  for (std::uint32_t i = 0; i < 600; ++i) {
    const Eigen::Vector3d random = random_vector(3, 2 * i), target = 0.7 * random_vector(3, 2 * i + 1);
    Eigen::Vector3d origin = 2 * random;
    if (const auto* const field = std::get_if<HeightFieldShape>(&shape))  // above it: it has no walls at its border
      origin = field->position + field->rotation * Eigen::Vector3d(1.1 + 1.1 * random[0], 1 + random[1], 1 + random[2]);
    Ray ray{origin, (target - origin).normalized()};
    if (i % 5 == 0) ray.direction = kTurn.col(i / 5 % 3) * (i % 10 == 0 ? 1 : -1);  // along the axes of a shape
    const std::optional<double> found = entry(shape, ray, kReach);
    if (signed_distance(shape, ray.origin) < 0) {
      ++inside;
      EXPECT_FALSE(found) << i;
      continue;
    }
    ++(found ? hits : misses);
    if (found) {
      EXPECT_NEAR(signed_distance(shape, ray.at(*found)), 0, kRounding) << i;
      EXPECT_TRUE(entry(shape, ray, *found * (1 + kRounding))) << i;
      EXPECT_FALSE(entry(shape, ray, *found * (1 - kRounding))) << i;
    }
    for (int sample = 0; sample < kSamples; ++sample)
      EXPECT_GE(signed_distance(shape, ray.at(sample * found.value_or(kReach) / kSamples)), -kRounding) << i;
  }
  EXPECT_GT(hits, 60);
  EXPECT_GT(misses, 60);
  EXPECT_GT(inside, 1);
}

TEST(Ray, MeetsTrianglesFromEitherSide) {
  const Eigen::Vector3d a(0, 0, 1), b(2, 0, 1), c(0, 2, 1);
  for (const double side : {-1.0, 1.0}) {
    const Ray ray{{0.5, 0.2, 1 + 3 * side}, {0, 0, -side}};
    const std::optional<TriangleHit> hit = triangle_hit(ray, a, b, c);
    ASSERT_TRUE(hit);
    EXPECT_EQ(hit->distance, 3);
    EXPECT_LT((hit->shares - Eigen::Vector3d(0.65, 0.25, 0.1)).norm(), 1e-15);
    EXPECT_FALSE(triangle_hit({ray.origin, -ray.direction}, a, b, c));
    EXPECT_FALSE(triangle_hit({{1.1, 1.1, 1 + 3 * side}, ray.direction}, a, b, c));
    EXPECT_FALSE(triangle_hit({ray.origin, {1, 0, 0}}, a, b, c));  // beside its plane
  }
}

}  // namespace ray_test
}  // namespace exmat::runtime
