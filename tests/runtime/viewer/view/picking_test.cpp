#include "runtime/viewer/view/picking.h"

#include <gtest/gtest.h>
#include <random>

#include "exmat/exmat.hpp"

namespace exmat::viewer {
namespace picking_test {

const std::vector<double> kTetrahedron{0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1};
const std::vector<std::int32_t> kFaces{0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3};

Eigen::Vector3d place_of(const SurfaceHit& hit) {
  Eigen::Vector3d place = Eigen::Vector3d::Zero();
  for (std::size_t c = 0; c < 3; ++c)
    place += hit.shares[static_cast<Eigen::Index>(c)] *
             Eigen::Map<const Eigen::Vector3d>(kTetrahedron.data() +
                                               3 * kFaces[3 * static_cast<std::size_t>(hit.triangle) + c]);
  return place;
}

TEST(Picking, FindsTheNearestOfTheTriangles) {
  const std::vector<float> points(kTetrahedron.begin(), kTetrahedron.end());
  const Ray ray{{2, 2, 2}, Eigen::Vector3d(-1, -1, -1).normalized()};
  const SurfaceHit hit = first_hit(ray, points, kFaces).value();
  EXPECT_EQ(hit.triangle, 3);
  EXPECT_LE((place_of(hit) - Eigen::Vector3d::Constant(1.0 / 3)).norm(), 1e-6);
  EXPECT_LE((ray.at(hit.distance) - place_of(hit)).norm(), 1e-6);
  EXPECT_FALSE(first_hit({{2, 2, 2}, {1, 0, 0}}, points, kFaces));
}

// No place of the surface, by samples, is nearer.
TEST(Picking, FindsTheNearestPlaceOfASurface) {
  std::mt19937 generator(1);
  std::uniform_real_distribution<double> number(-1, 2);
  for (int trial = 0; trial < 50; ++trial) {
    const Eigen::Vector3d point(number(generator), number(generator), number(generator));
    const SurfaceHit found = nearest_place(point, kTetrahedron, kFaces);
    EXPECT_NEAR(found.shares.sum(), 1, 1e-12);
    EXPECT_NEAR((place_of(found) - point).norm(), found.distance, 1e-12);
    for (std::int64_t triangle = 0; triangle < 4; ++triangle)
      for (int i = 0; i <= 20; ++i)
        for (int j = 0; i + j <= 20; ++j)
          EXPECT_GE((place_of({triangle, {i / 20.0, j / 20.0, (20 - i - j) / 20.0}, 0}) - point).norm(),
                    found.distance - 1e-12);
  }
}

/// Distance to a segment.
double away(const Eigen::Vector3d& p, const Eigen::Vector3d& a, const Eigen::Vector3d& axis) {
  const double t = std::clamp((p - a).dot(axis) / axis.squaredNorm(), 0.0, 1.0);
  return (p - a - t * axis).norm();
}

TEST(Picking, FindsObstaclesWhereTheyStand) {
  exmat_motion motion{};
  motion.position[0] = 0.5;
  motion.orientation[0] = std::sqrt(0.5);
  motion.orientation[3] = std::sqrt(0.5);  // x becomes y
  exmat_obstacle obstacle = default_obstacle();
  obstacle.radius = 0.3;
  const Ray ray{{5, 0.1, 0.2}, Eigen::Vector3d(-1, 0, 0)};
  obstacle.shape = EXMAT_SPHERE;
  EXPECT_NEAR((ray.at(*obstacle_hit(ray, obstacle, {}, motion)) - Eigen::Vector3d(0.5, 0, 0)).norm(), 0.3, 1e-12);
  obstacle.shape = EXMAT_BOX;
  obstacle.half_extents[1] = 0.25;
  EXPECT_NEAR(ray.at(*obstacle_hit(ray, obstacle, {}, motion)).x(), 0.75, 1e-12);
  obstacle.shape = EXMAT_CAPSULE;
  obstacle.direction[0] = 2;
  obstacle.direction[2] = 0;
  const Eigen::Vector3d on = ray.at(*obstacle_hit(ray, obstacle, {}, motion));
  EXPECT_NEAR(away(on, {0.5, 0, 0}, {0, 2, 0}), 0.3, 1e-12);
  // The face x = 2 of a box by two triangles, before it is turned and moved: y = 2 in the world.
  obstacle.shape = EXMAT_MESH;
  const std::array<double, 18> face{2, -1, -1, 2, 1, -1, 2, 1, 1, 2, -1, -1, 2, 1, 1, 2, -1, 1};
  const Ray across{{0.4, 9, -0.3}, Eigen::Vector3d(0, -1, 0)};
  EXPECT_NEAR(obstacle_hit(across, obstacle, face, motion).value(), 7, 1e-12);
  EXPECT_FALSE(obstacle_hit(ray, obstacle, face, motion));
  obstacle.shape = EXMAT_PLANE;
  EXPECT_FALSE(obstacle_hit(ray, obstacle, {}, motion));
}

}  // namespace picking_test
}  // namespace exmat::viewer
