#include <algorithm>
#include <gtest/gtest.h>

#include "tests/runtime/sim/world/touching_blocks.h"

// Bodies of a world that rest are left alone, island by island.

namespace exmat::runtime {
namespace {

using test::Blocks;

constexpr double kGravity = 9.81;

/// A stack of three on a floor.
struct Piles {
  Piles() : blocks(2e-3) {
    blocks.set_gravity(kGravity);
    blocks.add_floor(1e7, 0.5, 1e5);
    blocks.scene.mass_damping = 4;
    blocks.scene.stiffness_damping = 4e-3;
    blocks.scene.sleep = {1e-5, 0.1};
  }
  std::vector<WorldBodyStart> stack() const {
    std::vector<WorldBodyStart> bodies;
    for (int i = 0; i < 3; ++i) bodies.push_back(blocks.body({0, 0, 0.001 + 0.201 * i}));
    return bodies;
  }

  Blocks blocks;
};

bool rests_within(World& world, int steps, int asleep) {
  for (int i = 0; i < steps; ++i)
    if (world.step(1).asleep == asleep) return true;
  return false;
}

std::vector<Eigen::VectorXd> poses(const World& world) {
  std::vector<Eigen::VectorXd> found;
  for (int i = 0; i < world.count(); ++i) {
    found.push_back(world.state(i).q);
    found.push_back(free_state(world.state(i)).position);
  }
  return found;
}

TEST(WorldSleep, AStackFallsAsleepAsAWholeAndNothingOfItMoves) {
  const Piles piles;
  World world(piles.stack(), {1e7, 1e5, 0.5});
  int before = -1;
  for (int i = 0; i < 4000 && before != 3; ++i) {
    before = world.step(1).asleep;
    ASSERT_TRUE(before == 0 || before == 3) << "at step " << i;
  }
  ASSERT_EQ(before, 3);
  const auto there = poses(world);
  const std::int64_t step = world.state(0).step;
  for (int i = 0; i < 100; ++i) {
    const WorldReport report = world.step(2);
    EXPECT_EQ(report.islands, 0);
    EXPECT_EQ(report.asleep, 3);
  }
  EXPECT_EQ(poses(world), there);
  EXPECT_EQ(world.state(2).step, step + 100);
  EXPECT_EQ(world.held().size(), 2U) << "it remembers what touches";
}

TEST(WorldSleep, WhatActsOnOneWakesAllThatItTouches) {
  Piles piles;
  std::vector<WorldBodyStart> bodies = piles.stack();
  bodies.push_back(piles.blocks.body({5, 0, 0.001}));
  World world(std::move(bodies), {1e7, 1e5, 0.5});
  ASSERT_TRUE(rests_within(world, 4000, 4));
  world.state(2).applied_force[0] += 1e-3;
  EXPECT_EQ(world.step(1).asleep, 1) << "the block beside it goes on sleeping";
  EXPECT_EQ(world.step(1).largest_island, 3);
  EXPECT_TRUE(rests_within(world, 4000, 4));
}

TEST(WorldSleep, ABodyThatComesNearWakesTheStack) {
  Piles piles;
  std::vector<WorldBodyStart> bodies = piles.stack();
  bodies.push_back(piles.blocks.body({0, 0, 2.5}));
  bodies.push_back(piles.blocks.body({5, 0, 0.001}));
  World world(std::move(bodies), {1e7, 1e5, 0.5});
  world.state(3).sleep = {};
  bool slept = false, woke = false;
  for (int i = 0; i < 6000; ++i) {
    if (!slept) {  // it hangs where it is until the stack rests
      FrameMotion motion;
      motion.position = Eigen::Vector3d(0, 0, 2.5);
      set_motion(world.model(3), motion, world.state(3));
      world.state(3).begins_anew = true;
    }
    const WorldReport report = world.step(1);
    slept = slept || report.asleep == 4;
    woke = woke || (slept && report.largest_island == 4);
  }
  EXPECT_TRUE(slept);
  EXPECT_TRUE(woke);
  EXPECT_EQ(world.step(1).asleep, 5) << "and all come to rest again";
}

TEST(WorldSleep, GoesOnFromItsMemoryToTheLastBit) {
  const Piles piles;
  World world(piles.stack(), {1e7, 1e5, 0.5});
  ASSERT_TRUE(rests_within(world, 4000, 3));
  std::vector<WorldBodyStart> kept = piles.stack();
  for (int i = 0; i < 3; ++i) kept[static_cast<std::size_t>(i)].state = world.state(i);
  World other(std::move(kept), {1e7, 1e5, 0.5});
  other.set_memory(world.held());
  for (World* each : {&world, &other}) {
    for (int i = 0; i < 20; ++i) EXPECT_EQ(each->step(1).asleep, 3);
    each->state(1).applied_force[0] += 1e-3;
    for (int i = 0; i < 20; ++i) EXPECT_EQ(each->step(1).asleep, 0);
  }
  EXPECT_EQ(poses(world), poses(other));
}

// Blocks whose masks do not meet are as good as in two worlds: to the last bit.
TEST(WorldGroups, BodiesThatDoNotMeetPassThroughEachOther) {
  Blocks first(1e-3), second(1e-3);
  first.scene.meeting = {1, 1};
  second.scene.meeting = {2, 2};
  const auto bodies = [&](bool both) {
    std::vector<WorldBodyStart> found{first.body({0, 0, 0}, {1, 0, 0})};
    if (both) found.push_back(second.body({0.45, 0, 0}, {-1, 0, 0}));
    return found;
  };
  World together(bodies(true), {1e7, 0, 0.5}), alone(bodies(false), {1e7, 0, 0.5});
  for (int i = 0; i < 400; ++i) {
    EXPECT_EQ(together.step(1).pairs, 0);
    alone.step(1);
  }
  EXPECT_EQ(together.state(0).q, alone.state(0).q);
  EXPECT_EQ(free_state(together.state(0)).position, free_state(alone.state(0)).position);
  second.scene.meeting = {2, 3};
  World one_sided(bodies(true), {1e7, 0, 0.5});
  for (int i = 0; i < 400; ++i) EXPECT_EQ(one_sided.step(1).pairs, 0) << "both have to want it";
  first.scene.meeting = {1, 2};
  World meeting(bodies(true), {1e7, 0, 0.5});
  int most = 0;
  for (int i = 0; i < 400; ++i) most = std::max(most, meeting.step(1).touching_pairs);
  EXPECT_EQ(most, 1);
}

}  // namespace
}  // namespace exmat::runtime
