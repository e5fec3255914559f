#include <gtest/gtest.h>

#include "tests/runtime/sim/world/touching_blocks.h"

namespace exmat::runtime {
namespace {

using test::Blocks;

/// Slabs of 0.3 x 0.3 x `thickness` m.
exmat::test::BarOptions slab(double thickness) {
  return {.cells = {3, 3, 2}, .lengths = {0.3, 0.3, thickness}, .youngs_modulus = 1e6, .free = true};
}

// Face to face, flush or turned against each other: they bounce, however fast they are, and do not pass through each
// other. Both meet in the middle: few vertices carry them, and beside it they would turn away from each other.
TEST(FastBodies, DoNotPassThroughEachOther) {
  for (const double time_step : {1.0 / 60, 1.0 / 240, 1e-3})
    for (const double speed : {5.0, 50.0})
      for (const double thickness : {0.3, 0.03})
        for (const auto& [angle, stiffness] : {std::pair(0.0, 1e8), {0.8, 1e8}, {0.0, 1e6}}) {
          if (stiffness < 1e8 && thickness > 0.1) continue;  // too soft to stop them within their size
          const Blocks blocks(time_step, slab(thickness));
          const double apart = thickness + 0.35;
          const Eigen::Quaterniond turn(Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitZ()));
          std::vector<WorldBodyStart> bodies;
          bodies.push_back(blocks.body({0, 0, 0}, {0, 0, 0.5 * speed}));
          bodies.push_back(blocks.body({0, 0, apart}, {0, 0, -0.5 * speed}, Eigen::Vector3d::Zero(), turn));
          World world(bodies, {stiffness, 0, 0.2});
          const test::Momenta before = test::momenta(blocks, world);
          const double energy = world.energies().total();
          double highest = energy;
          int touching = 0;
          const auto steps = static_cast<int>(std::ceil(2 * apart / speed / time_step + 0.1 / time_step)) + 40;
          for (int i = 0; i < steps; ++i) {
            touching += world.step(1).touching_pairs;
            highest = std::max(highest, world.energies().total());
          }
          SCOPED_TRACE(testing::Message() << time_step << " s, " << speed << " m/s, " << thickness << " m, " << angle
                                          << " rad, " << stiffness << " N/m^3");
          EXPECT_GT(touching, 0);
          EXPECT_LT(blocks.centre(world.state(0))[2] + 0.25 * thickness, blocks.centre(world.state(1))[2]);
          // They part, where the contact stops them within their thickness. Where that takes six times as far, rims go
          // past each other, and the slabs stay crumpled in each other, at rest but for a hundredth.
          const double stopped_within = speed * std::sqrt(0.5 * 1000 * thickness / stiffness);
          EXPECT_LT(free_state(world.state(0)).linear_momentum[2] - free_state(world.state(1)).linear_momentum[2],
                    stopped_within < thickness ? 0 : 0.01 * blocks.mass() * speed);
          EXPECT_LE(highest, energy * (1 + 1e-9));
          EXPECT_LE((test::momenta(blocks, world).linear - before.linear).norm(), 1e-12 * blocks.mass() * speed);
        }
}

// Beside each other nothing is felt of the other, to the last bit.
TEST(FastBodies, FlyPastEachOther) {
  const Blocks blocks(1.0 / 60, slab(0.3));
  std::vector<WorldBodyStart> bodies;
  bodies.push_back(blocks.body({0, 0, 0}, {0, 0, 40}));
  bodies.push_back(blocks.body({0.34, 0, 1}, {0, 0, -40}));
  World world(bodies, {1e8, 0, 0.2});
  for (int i = 0; i < 6; ++i) world.step(1);
  EXPECT_EQ(free_state(world.state(0)).linear_momentum, blocks.mass() * Eigen::Vector3d(0, 0, 40));
  EXPECT_EQ(free_state(world.state(1)).linear_momentum, blocks.mass() * Eigen::Vector3d(0, 0, -40));
}

}  // namespace
}  // namespace exmat::runtime
