#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <exmat/exmat.hpp>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <optional>
#include <random>
#include <vector>

#include "common/bundle/bundle.h"
#include "runtime/api/deformed_box.h"
#include "tests/support/synthetic_model.h"
#include "tests/support/temporary_folder.h"

namespace exmat::runtime {
namespace {

using ::testing::HasSubstr;

/// Bodies of two models in a world, deformed, turned and scattered, some of them in all their vertices.
class RayThroughAWorld : public ::testing::Test {
 protected:
  RayThroughAWorld() {
    const std::array bars{test::BarOptions{.free = true},
                          test::BarOptions{.cells = {3, 2, 2}, .lengths = {0.5, 0.4, 0.3}, .free = true}};
    for (std::size_t i = 0; i < bars.size(); ++i) {
      test::Bar bar = test::make_bar(bars[i]);
      bar.model.contact = test::surface_contact(bar.model);
      write_bundle(bar.model, folder_ / names_[i]);
      exmat_settings settings = exmat::default_settings();
      settings.space = i == 0 ? EXMAT_SPACE_REDUCED : EXMAT_SPACE_FULL;
      settings.use_contact = 1;
      models_.emplace_back(folder_ / names_[i], settings);
      surfaces_.emplace_back(models_[i], EXMAT_SURFACE_OBJECT);
    }
    exmat_contact_law law = exmat::default_contact_law();
    law.apart = 1;
    world_ = exmat::World(law);
    for (int i = 0; i < 12; ++i) {
      exmat::Body body(models_[static_cast<std::size_t>(i % 3 == 2)]);
      std::vector<double> q(body.model().modes()), v(q.size());
      for (double& number : q) number = 0.15 * spread();
      if (i % 3 != 2) body.set_reduced(q, v);
      const Eigen::Quaterniond turn = Eigen::Quaterniond(spread(), spread(), spread(), spread()).normalized();
      body.set_motion(
          {0, {3 * spread(), 3 * spread(), 3 * spread()}, {turn.w(), turn.x(), turn.y(), turn.z()}, {}, {}});
      world_.add(std::move(body));
    }
    static_cast<void>(world_.remove(4));  // ids are not places
    world_.step(2);
  }
  double spread() { return std::uniform_real_distribution(-1.0, 1.0)(random_); }
  Eigen::Vector3d vector_of_spreads() { return {spread(), spread(), spread()}; }

  /// Corners [3 x 3] of the triangles of a body, which exmat_body_read_positions_double() gives.
  std::vector<Eigen::Matrix3d> triangles(std::int64_t id, const exmat::Surface& surface) const {
    std::vector<double> xyz(3 * surface.points());
    world_.body(id).read_positions(surface, xyz);
    const std::vector<std::int32_t> corners = surface.triangles();
    std::vector<Eigen::Matrix3d> all(corners.size() / 3);
    for (std::size_t i = 0; i < corners.size(); ++i)
      all[i / 3].col(static_cast<Eigen::Index>(i % 3)) =
          Eigen::Map<const Eigen::Vector3d>(&xyz[3 * static_cast<std::size_t>(corners[i])]);
    return all;
  }
  std::optional<exmat::RayHit> cast(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction,
                                    double most = INFINITY) const {
    const std::array from{origin[0], origin[1], origin[2]}, along{direction[0], direction[1], direction[2]};
    return world_.cast_ray(both_, from, along, most);
  }
  std::size_t surface_of(std::int64_t id) const { return static_cast<std::size_t>(id % 3 == 2); }

  std::mt19937_64 random_{5};
  test::TemporaryFolder folder_;
  std::array<const char*, 2> names_{"bar.h5", "block.h5"};
  std::vector<exmat::Model> models_;
  std::vector<exmat::Surface> surfaces_;
  exmat::World world_;
  std::array<const exmat::Surface*, 2> both_{};
};

TEST_F(RayThroughAWorld, MeetsTheFirstOfAllTrianglesOfAllBodies) {
  both_ = {&surfaces_[0], &surfaces_[1]};
  struct Corners {
    std::int64_t body;
    std::vector<Eigen::Matrix3d> triangles;
  };
  std::vector<Corners> bodies;
  for (const std::int64_t id : world_.ids()) bodies.push_back({id, triangles(id, surfaces_[surface_of(id)])});
  ASSERT_EQ(bodies.size(), 11U);
  int hits = 0, in_all_vertices = 0;
  for (int i = 0; i < 400; ++i) {
    const auto& aimed = bodies[static_cast<std::size_t>(i) % bodies.size()].triangles;
    const Eigen::Vector3d target =
        aimed[static_cast<std::size_t>(7 * i) % aimed.size()].rowwise().mean() + 0.2 * vector_of_spreads();
    Eigen::Vector3d origin = 6 * vector_of_spreads();
    if (i % 4 == 0) origin = target + Eigen::Vector3d::Unit(i / 4 % 3) * (i % 8 == 0 ? 2 : -3);  // along an axis
    const Eigen::Vector3d direction = target - origin;
    double nearest = INFINITY;
    std::int64_t body = -1, triangle = -1;
    for (const Corners& each : bodies)
      for (std::size_t f = 0; f < each.triangles.size(); ++f) {
        const Eigen::Matrix3d& corners = each.triangles[f];
        Eigen::Matrix3d sides;
        sides << corners.col(1) - corners.col(0), corners.col(2) - corners.col(0), -direction.normalized();
        const Eigen::Vector3d at = sides.fullPivLu().solve(origin - corners.col(0));
        if (!(at[0] >= 0 && at[1] >= 0 && at[0] + at[1] <= 1 && at[2] >= 0 && at[2] < nearest)) continue;
        nearest = at[2];
        body = each.body;
        triangle = static_cast<std::int64_t>(f);
      }
    const std::optional<exmat::RayHit> hit = cast(origin, direction);
    ASSERT_EQ(hit.has_value(), body >= 0) << i;
    if (!hit) continue;
    ++hits;
    in_all_vertices += hit->surface == 1 ? 1 : 0;
    EXPECT_EQ(hit->body, body) << i;
    EXPECT_EQ(hit->surface, static_cast<std::int64_t>(surface_of(body))) << i;
    EXPECT_EQ(hit->triangle, triangle) << i;
    EXPECT_NEAR(hit->distance, nearest, 1e-11 * nearest) << i;
    const auto found = std::ranges::find(bodies, body, &Corners::body);
    const Eigen::Matrix3d& corners = found->triangles[static_cast<std::size_t>(triangle)];
    const Eigen::Vector3d place = corners * Eigen::Vector3d(hit->shares.data());
    EXPECT_LE((place - origin - nearest * direction.normalized()).norm(), 1e-10 * nearest) << i;
    const Eigen::Vector3d area = (corners.col(1) - corners.col(0)).cross(corners.col(2) - corners.col(0));
    EXPECT_LE((Eigen::Vector3d(hit->normal.data()) - area.normalized()).norm(), 1e-12) << i;
    const std::optional<exmat::RayHit> other = cast(origin, direction, 0.999 * nearest);
    EXPECT_FALSE(other) << i;
  }
  EXPECT_GT(hits, 60);
  EXPECT_LT(hits, 390);
  EXPECT_GT(in_all_vertices, 10);
}

TEST_F(RayThroughAWorld, SeesBodiesByTheirSurfacesAlone) {
  both_ = {&surfaces_[0], &surfaces_[1]};
  const std::vector<Eigen::Matrix3d> own = triangles(2, surfaces_[1]);
  const Eigen::Vector3d inside = own.front().rowwise().mean(), far(20, 21, 22);
  const std::array from{far[0], far[1], far[2]}, along{inside[0] - far[0], inside[1] - far[1], inside[2] - far[2]};
  ASSERT_TRUE(world_.cast_ray(both_, from, along));
  const std::array<const exmat::Surface*, 1> blocks{&surfaces_[1]};
  const std::optional<exmat::RayHit> hit = world_.cast_ray(blocks, from, along);
  ASSERT_TRUE(hit);
  EXPECT_EQ(hit->surface, 0);
  EXPECT_EQ(surface_of(hit->body), 1U);
  EXPECT_FALSE(world_.cast_ray({}, from, along));
}

// The plane and the box are where they were moved to; what is nearer of bodies and obstacles is met.
TEST_F(RayThroughAWorld, MeetsObstaclesThatLieBeforeBodies) {
  both_ = {&surfaces_[0], &surfaces_[1]};
  exmat_obstacle obstacle = exmat::default_obstacle();
  const std::int64_t plane = world_.add_obstacle(obstacle);
  obstacle.shape = EXMAT_BOX;
  const std::int64_t box = world_.add_obstacle(obstacle);
  exmat_motion motion{};
  motion.orientation[0] = 1;
  motion.position[2] = -30;
  world_.move_obstacle(plane, motion);
  motion.position[2] = 20;
  motion.orientation[0] = motion.orientation[3] = std::sqrt(0.5);
  motion.linear_velocity[0] = 3;
  world_.move_obstacle(box, motion);
  const std::optional<exmat::RayHit> lid = cast({0.2, 0.3, 25}, {0, 0, -2});
  ASSERT_TRUE(lid);
  EXPECT_EQ(lid->obstacle, box);
  EXPECT_EQ(lid->body, -1);
  EXPECT_EQ(lid->surface, -1);
  EXPECT_EQ(lid->triangle, -1);
  EXPECT_NEAR(lid->distance, 4, 1e-14);
  EXPECT_LE((Eigen::Vector3d(lid->normal.data()) - Eigen::Vector3d::UnitZ()).norm(), 1e-15);
  EXPECT_FALSE(cast({0.2, 0.3, 25}, {0, 0, -2}, 3.9));
  world_.step();  // the box goes on
  EXPECT_FALSE(cast({-0.99999, 0, 25}, {0, 0, -1}, 5));
  EXPECT_TRUE(cast({1.00001, 0, 25}, {0, 0, -1}, 5));

  const std::optional<exmat::RayHit> below = cast({50, 50, 0}, {0, 3, -4});
  ASSERT_TRUE(below);
  EXPECT_EQ(below->obstacle, plane);
  EXPECT_NEAR(below->distance, 30 / 0.8, 1e-12);
  EXPECT_FALSE(cast({50, 50, -31}, {0, 0, 1}));  // from within

  const Eigen::Vector3d middle = triangles(2, surfaces_[1]).front().rowwise().mean();
  const std::optional<exmat::RayHit> body = cast(middle + Eigen::Vector3d(0, 0, 12), {0, 0, -1});
  ASSERT_TRUE(body);
  EXPECT_GE(body->body, 0);
  EXPECT_EQ(body->obstacle, -1);
  const std::array from{middle[0], middle[1], middle[2] + 12}, down{0.0, 0.0, -1.0};
  EXPECT_EQ(world_.cast_ray({}, from, down)->obstacle, plane);
  // Callers from before obstacles were seen go on without.
  exmat_ray_hit old{};
  old.size = offsetof(exmat_ray_hit, obstacle);
  ASSERT_EQ(exmat_world_cast_ray(world_.get(), nullptr, 0, from.data(), down.data(), INFINITY, &old), EXMAT_OK);
  EXPECT_EQ(old.body, -1);
  EXPECT_EQ(old.distance, 0);
}

TEST_F(RayThroughAWorld, RefusesWhatIsNoRay) {
  const exmat_surface* const surface = surfaces_[0].get();
  const exmat_surface* const none = nullptr;
  const std::array origin{0.0, 0.0, 0.0}, up{0.0, 0.0, 1.0}, nowhere{0.0, 0.0, 0.0}, bad{0.0, double{NAN}, 0.0};
  exmat_ray_hit hit{};
  hit.size = sizeof hit;
  const auto refuses = [&](const exmat_surface* const* surfaces, std::int64_t count, const double* from,
                           const double* along, double most, const char* words) {
    EXPECT_EQ(exmat_world_cast_ray(world_.get(), surfaces, count, from, along, most, &hit), EXMAT_INVALID_ARGUMENT);
    EXPECT_THAT(exmat_last_error(), HasSubstr(words));
  };
  refuses(nullptr, 1, origin.data(), up.data(), 1, "surfaces is NULL");
  refuses(&none, 1, origin.data(), up.data(), 1, "surfaces[0] is NULL");
  refuses(&surface, -1, origin.data(), up.data(), 1, "count = -1: expected >= 0");
  refuses(&surface, 1, nullptr, up.data(), 1, "origin is NULL");
  refuses(&surface, 1, origin.data(), nullptr, 1, "direction is NULL");
  refuses(&surface, 1, bad.data(), up.data(), 1, "numbers within 1e30");
  refuses(&surface, 1, origin.data(), nowhere.data(), 1, "direction: expected one that is not 0");
  refuses(&surface, 1, origin.data(), up.data(), -1, "a distance >= 0");
  refuses(&surface, 1, origin.data(), up.data(), NAN, "a distance >= 0");
  EXPECT_EQ(exmat_world_cast_ray(nullptr, &surface, 1, origin.data(), up.data(), 1, &hit), EXMAT_INVALID_ARGUMENT);
  EXPECT_EQ(exmat_world_cast_ray(world_.get(), &surface, 1, origin.data(), up.data(), 1, nullptr),
            EXMAT_INVALID_ARGUMENT);
  hit.size = 8;
  refuses(&surface, 1, origin.data(), up.data(), 1, "size = 8: expected 96");
}

TEST(DeformedBox, HoldsAllPointsAndIsTightAtRest) {
  std::mt19937_64 random(3);
  const auto spread = [&] { return std::uniform_real_distribution(-1.0, 1.0)(random); };
  PointSet points;
  points.rest = VertexArray::NullaryExpr(40, 3, spread);
  points.basis_rows = RowMatrix::NullaryExpr(120, 5, spread);
  const DeformedBox box(points);
  const auto bounds = [&](const Eigen::VectorXd& q) {
    Eigen::AlignedBox3d exact;
    for (Eigen::Index i = 0; i < 40; ++i)
      exact.extend(points.rest.row(i).transpose() + points.basis_rows.middleRows<3>(3 * i) * q);
    return exact;
  };
  for (int i = 0; i < 50; ++i) {
    const Eigen::VectorXd q = Eigen::VectorXd::NullaryExpr(5, spread);
    EXPECT_TRUE(box.at(q).contains(bounds(q))) << i;
  }
  const Eigen::VectorXd none = Eigen::VectorXd::Zero(5);
  EXPECT_TRUE(box.at(none).isApprox(bounds(none), 1e-8));
}

}  // namespace
}  // namespace exmat::runtime
