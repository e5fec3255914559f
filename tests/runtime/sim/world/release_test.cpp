#include <gtest/gtest.h>

#include "tests/runtime/sim/world/fork.h"
#include "tests/runtime/sim/world/touching_blocks.h"
#include "tests/support/random.h"

namespace exmat::runtime {
namespace {

using test::Blocks;

constexpr double kDeep = 0.08;  // [m] of blocks of 0.2 m

double speed_of(const Blocks& blocks, const World& world, int body) {
  return free_state(world.state(body)).linear_momentum.norm() / blocks.mass();
}

/// Fastest centre in a second, or what is faster than the release lets be.
double fastest_of(const Blocks& blocks, World& world) {
  double fastest = 0;
  for (int i = 0; i < static_cast<int>(std::lround(1 / blocks.scene.time_step)); ++i) {
    world.step(1);
    for (int body = 0; body < world.count(); ++body) {
      fastest = std::max(fastest, speed_of(blocks, world, body));
      EXPECT_EQ(world.report(body).status & kStepNonFinite, 0U);
    }
  }
  return fastest;
}

// A spring over the depth would throw it at 30 m/s and more.
TEST(Release, ABodyThatBeginsInTheFloorIsLetOutSlowly) {
  for (const double time_step : {1e-3, 1.0 / 60})
    for (const double gravity : {0.0, 9.81})
      for (const bool sphere : {false, true}) {
        SCOPED_TRACE(testing::Message() << time_step << " s, " << gravity << " m/s^2, sphere " << sphere);
        Blocks blocks(time_step);
        blocks.set_gravity(gravity);
        if (sphere)
          blocks.scene.obstacles.push_back(Obstacle{Sphere{{0.2, 0.1, -10}, 10}, RigidMotion(), 1e8, 1e4, 0.3});
        else
          blocks.add_floor(1e8, 0.3, 1e4);
        World world({blocks.body({0, 0, -kDeep})}, {1e7, 0, 0});
        EXPECT_LE(fastest_of(blocks, world), 2 * kRelease);
        EXPECT_GE(blocks.centre(world.state(0))[2], 0.1 - 0.01) << "it is out";
      }
}

// Nearest points would pull it apart to all sides, and it would snap out at up to 80 m/s.
TEST(Release, ABodyThatIsPutDeepIntoACurvedObstacleIsLetOutToOneSide) {
  const Eigen::Vector3d centre(0.2, 0.1, 0.1);
  const std::vector<std::pair<std::string, Shape>> shapes{
      {"beside the middle of a large sphere", Sphere{{0.12, 0.1, 0.1}, 1.2}},
      {"in the middle of a small sphere", Sphere{centre, 0.36}},
      {"on the axis of a capsule", Capsule{centre - Eigen::Vector3d::UnitX(), centre + Eigen::Vector3d::UnitX(), 0.8}},
      {"across a plate", Box{centre, {0.12, 1, 1}}}};
  for (const auto& [name, shape] : shapes)
    for (const double youngs_modulus : {1e3, 1e5, 1e7}) {
      SCOPED_TRACE(testing::Message() << name << ", E " << youngs_modulus);
      exmat::test::BarOptions options = Blocks::free_block();
      options.youngs_modulus = youngs_modulus;
      Blocks blocks(2e-3, options);
      blocks.scene.obstacles.push_back(Obstacle{shape, RigidMotion(), 1e8, 0, 0});
      World world({blocks.body({0, 0, 0})}, {1e7, 0, 0});
      // Soft ones are stretched on their way.
      const double limit = (youngs_modulus < 1e4 ? 3 : 2) * kRelease;
      for (int second = 0; second < 4; ++second) EXPECT_LE(fastest_of(blocks, world), limit);
      if (!std::holds_alternative<Box>(shape))  // both ends are out, and hold it there
        EXPECT_GT(signed_distance(shape, blocks.centre(world.state(0))), 0) << "it is out";
    }
}

TEST(Release, BodiesThatBeginInEachOtherPartSlowly) {
  for (const double time_step : {1e-3, 1.0 / 60})
    for (const double friction : {0.0, 0.5}) {
      SCOPED_TRACE(testing::Message() << time_step << " s, friction " << friction);
      const Blocks blocks(time_step);
      World world({blocks.body({0, 0, 0}), blocks.body({0.4 - kDeep, 0.01, 0.02})}, {1e8, 0, friction});
      EXPECT_LE(fastest_of(blocks, world), kRelease);
      EXPECT_TRUE(world.held().empty());
      EXPECT_GE((blocks.centre(world.state(0)) - blocks.centre(world.state(1))).norm(), 0.4);
    }
}

// Nearest points of the surface would push deep vertices to all sides, and those of bodies in one place nowhere.
TEST(Release, BodiesThatBeginDeepInEachOtherPart) {
  for (const Eigen::Vector3d& apart :
       {Eigen::Vector3d(0, 0, 0), Eigen::Vector3d(1e-7, 0, 0), Eigen::Vector3d(1e-4, 2e-4, 0),
        Eigen::Vector3d(0.01, -0.02, 0.015), Eigen::Vector3d(0.1, 0.03, 0.05)})
    for (const double friction : {0.0, 0.5}) {
      SCOPED_TRACE(testing::Message() << apart.transpose() << ", friction " << friction);
      const Blocks blocks(1e-3);
      World world({blocks.body({0, 0, 0}), blocks.body(apart)}, {1e8, 0, friction});
      EXPECT_LE(fastest_of(blocks, world), 2 * kRelease);
      fastest_of(blocks, world);  // another second
      EXPECT_TRUE(world.held().empty());
      EXPECT_GE((blocks.centre(world.state(0)) - blocks.centre(world.state(1))).norm(), 0.2);
    }
}

// Vertices on the surface that were taken for inside, those that came in by the back of a body on its way out, and ways
// out that differed from vertex to vertex kept most of them in each other; other limbs of bodies that are not convex
// did.
TEST(Release, TurnedBodiesThatBeginInEachOtherPart) {
  for (const bool forks : {false, true})
    for (int seed = 0; seed < 20; ++seed) {
      const Eigen::VectorXd chosen = test::random_vector(8, 100 + seed);
      SCOPED_TRACE(testing::Message() << "forks " << forks << ", seed " << seed);
      exmat::test::BarOptions options = forks ? test::fork(/*free=*/true) : Blocks::free_block();
      options.youngs_modulus = std::pow(10.0, 4 + seed % 4);
      const Blocks blocks(seed % 2 == 0 ? 1.0 / 240 : 1.0 / 60, options);
      Eigen::Quaterniond turn(chosen.head<4>());
      // Also about an axis of both, and on each other.
      if (seed < 3) turn = Eigen::AngleAxisd(seed == 0 ? EIGEN_PI : 0.5, Eigen::Vector3d::Unit(seed));
      const Eigen::Vector3d apart = seed < 10 ? Eigen::Vector3d::Zero() : Eigen::Vector3d(0.1 * chosen.tail<3>());
      World world({blocks.body({0, 0, 0}), blocks.body(apart, {0, 0, 0}, {0, 0, 0}, turn.normalized())},
                  {1e7, 0, chosen[4] > 0 ? 0.5 : 0.0});
      for (int second = 0; second < 3; ++second) EXPECT_LE(fastest_of(blocks, world), 2 * kRelease);
      // Prongs may still touch.
      for (const HeldPair& pair : world.held()) {
        EXPECT_FALSE(pair.overlaps());
        for (const auto& held : pair.held)
          for (const HeldBodyContact& contact : held) EXPECT_GT(contact.gap, -1e-3);
      }
    }
}

// They stayed in each other by friction, and left at 10 m/s by springs that others' release had filled.
TEST(Release, SoftBodiesInOnePlacePartWhateverTheirFriction) {
  for (const double stiffness : {1e6, 1e9})
    for (const double friction : {0.0, 1.0}) {
      SCOPED_TRACE(testing::Message() << stiffness << " N/m^3, friction " << friction);
      const Blocks blocks(1e-3, {.cells = {3, 3, 3}, .lengths = {1, 1, 1}, .youngs_modulus = 3e3, .free = true});
      World world({blocks.body({0, 0, 0}), blocks.body({0, 0, 0})}, {stiffness, 0, friction});
      for (int second = 0; second < 2; ++second) EXPECT_LE(fastest_of(blocks, world), kRelease);
      EXPECT_TRUE(world.held().empty());
    }
}

// A depth that it could have come in by within two steps was taken for one that it had: 3.5 times its energy.
TEST(Release, ABodyThatMovesFastWhereItBeginsInAnObstacleGainsNothing) {
  for (const double depth : {0.05, 0.2, 0.4}) {
    Blocks blocks(1.0 / 120, {.cells = {3, 3, 3}, .lengths = {1, 1, 1}, .youngs_modulus = 3e3, .free = true});
    blocks.add_floor(1e8, 0, 0);
    World world({blocks.body({0, 0, -depth}, {0, 0, -34})}, {1e7, 0, 0});
    const double start = world.energies().total();
    for (int i = 0; i < 60; ++i) {
      world.step(1);
      ASSERT_LE(world.energies().total(), start) << "step " << i << ", " << depth << " m";
    }
  }
}

TEST(Release, GoesOnFromItsMemoryToTheLastBit) {
  Blocks blocks(1e-3);
  blocks.add_floor(1e8, 0.3, 0);
  World world({blocks.body({0, 0, -0.03}), blocks.body({0.4 - kDeep, 0.01, 0.02})}, {1e8, 0, 0.3});
  for (int i = 0; i < 15; ++i) world.step(1);
  std::vector<WorldBodyStart> bodies{blocks.body({0, 0, 0}), blocks.body({0, 0, 0})};
  for (int i = 0; i < 2; ++i) bodies[static_cast<std::size_t>(i)].state = world.state(i);
  World other(std::move(bodies), {1e8, 0, 0.3});
  other.set_memory(world.held());
  for (int i = 0; i < 30; ++i) {
    world.step(1);
    other.step(1);
  }
  for (int i = 0; i < 2; ++i) EXPECT_EQ(world.state(i).q, other.state(i).q);
}

}  // namespace
}  // namespace exmat::runtime
