#include <algorithm>
#include <gtest/gtest.h>

#include "tests/runtime/sim/world/fork.h"

namespace exmat::runtime {
namespace {

using test::Fork;

/// A fork in its modes (false) or in all vertices (true).
class SelfContact : public testing::TestWithParam<bool> {};
INSTANTIATE_TEST_SUITE_P(Spaces, SelfContact, testing::Bool(),
                         [](const auto& info) { return info.param ? "Full" : "Reduced"; });

TEST_P(SelfContact, ProngsThatCloseStopAtEachOther) {
  for (const double time_step : {2e-4, 1e-3, 4e-3})
    for (const double stiffness : {1e7, 1e9}) {
      SCOPED_TRACE(testing::Message() << time_step << " s, " << stiffness << " N/m^3");
      double smallest[2] = {1, 1}, deepest = 0;
      for (const bool meets_itself : {false, true}) {
        const Fork fork(time_step, false, meets_itself);
        World world({fork.closed_to(0.02, 10.0, Eigen::Vector3d::Zero(), GetParam())},
                    {stiffness, stiffness / 1e4, 0.3});
        const double start = world.energies().total();
        int touching = 0;
        for (int i = 0; i < static_cast<int>(0.2 / time_step); ++i) {
          const WorldReport report = world.step(1);
          ASSERT_EQ(report.unconverged_islands, 0) << i;
          touching += report.touching_pairs;
          ASSERT_LE(world.energies().total(), start * (1 + 1e-9)) << i;
          smallest[meets_itself ? 1 : 0] = std::min(smallest[meets_itself ? 1 : 0], fork.gap(world.state(0)));
          for (const HeldPair& pair : world.held())
            for (const HeldBodyContact& contact : pair.held[0]) deepest = std::max(deepest, -contact.gap);
        }
        EXPECT_EQ(touching > 0, meets_itself);
      }
      EXPECT_LT(smallest[0], -0.01);
      // Half of a prong, 3 kg, stopped from 10 m/s by a pressure of k depth on half a cell at its end at least, 0.0064
      // m^2. The modes keep the ends plane; of all vertices one at a corner may slide off the other's.
      const double most = 10 * std::sqrt(3 / (stiffness * 0.0064));
      EXPECT_LT(deepest, most);
      if (!GetParam()) EXPECT_GT(smallest[1], -most);
    }
}

TEST_P(SelfContact, AFreeBodyKeepsItsMomenta) {
  constexpr double kSpeed = 10;  // [m/s]: at 3 the prongs turn round before they meet
  for (const double time_step : {2e-4, 2e-3}) {
    const Fork fork(time_step, true, true);
    World world({fork.closed_to(0.02, kSpeed, {1, 4, 2}, GetParam())}, {1e8, 1e4, 0.4});
    const test::Momenta before = test::momenta(fork.blocks, world);
    const double start = world.energies().total();
    int touching = 0;
    for (int i = 0; i < static_cast<int>(0.1 / time_step); ++i) {
      const WorldReport report = world.step(1);
      ASSERT_EQ(report.unconverged_islands, 0);
      touching += report.touching_pairs;
      const test::Momenta now = test::momenta(fork.blocks, world);
      ASSERT_LE((now.linear - before.linear).norm(), 1e-12 * fork.blocks.mass() * kSpeed);
      ASSERT_LE((now.angular - before.angular).norm(), 1e-12 * fork.blocks.mass() * kSpeed);
      ASSERT_LE(world.energies().total(), start * (1 + 1e-9));
    }
    EXPECT_GT(touching, 3);
  }
}

TEST_P(SelfContact, WhatOverlapsAtTheStartNeverPushes) {
  const Fork fork(1e-3, false, true);
  const auto start = [&] { return fork.closed_to(-0.02, 0, Eigen::Vector3d::Zero(), GetParam()); };
  // The other law has no force to speak of.
  World soft({start()}, {1e-12, 0, 0}), hard({start()}, {1e8, 1e4, 0.3});
  for (int i = 0; fork.gap(soft.state(0)) < -1e-3; ++i) {
    ASSERT_LT(i, 200);
    soft.step(1);
    hard.step(1);
    EXPECT_TRUE(hard.held().empty() || hard.held()[0].held[0].empty());
    ASSERT_EQ(hard.state(0).q, soft.state(0).q) << i;
  }
}

TEST_P(SelfContact, ABodyAtRestTakesTheStepOfASingleBody) {
  const Fork plain(1e-3, true, false), fork(1e-3, true, true);
  const auto start = [](const Fork& of) { return of.closed_to(0.075, 0.05, Eigen::Vector3d::Zero(), GetParam()); };
  World without({start(plain)}, {1e8, 1e4, 0.3}), with({start(fork)}, {1e8, 1e4, 0.3});
  for (int i = 0; i < 50; ++i) {
    without.step(1);
    EXPECT_EQ(with.step(1).islands, 0);
    ASSERT_EQ(with.state(0).q, without.state(0).q);
  }
}

// No basis has learned what a part of a body does to another.
TEST(SelfContactInFullSpace, IsEnteredByABodyThatTouchesItself) {
  Fork fork(1e-3, false, true);
  fork.blocks.full_scene.space.space = Space::kAuto;
  fork.blocks.full_scene.space.release = 0.05;
  World world({fork.closed_to(0.02, 10, Eigen::Vector3d::Zero(), true)}, {1e8, 1e4, 0.3});
  int first = -1, last = -1;
  for (int i = 0; last < 0 || i < last + 60; ++i) {
    ASSERT_LT(i, 1000);
    const bool touched_before = last >= 0 && last == i - 1;
    world.step(1);
    if (first < 0) EXPECT_FALSE(world.state(0).full) << i;
    if (touched_before) EXPECT_TRUE(world.state(0).full) << i;
    if (world.report(0).contacts == 0) continue;
    if (first < 0) first = i;
    last = i;
  }
  EXPECT_GT(last, first + 3);
  EXPECT_FALSE(world.state(0).full);
}

// All modes of a mesh and all of its vertices are one and the same, stepped and searched in two ways.
TEST(SelfContactInFullSpace, ProngsCloseAsInAllModes) {
  Fork fork(1e-3, false, true);
  fork.blocks.full_scene.space.newton = {50, 1e-10};
  Fork all(1e-3, false, true, static_cast<int>(fork.blocks.full->space.size()));
  all.blocks.scene.newton = {50, 1e-10};
  // Friction follows normal forces to a hundredth (kSameFriction) of what it does.
  for (const auto& [friction, tolerance] : {std::pair(0.0, 1e-11), std::pair(0.3, 1e-4)}) {
    SCOPED_TRACE(friction);
    const ContactLaw law{1e9, 1e5, friction};
    World full({fork.closed_to(0.02, 10, Eigen::Vector3d::Zero(), true)}, law);
    World reduced({all.closed_to(0.02, 10)}, law);
    int touching = 0;
    for (int i = 0; i < 40; ++i) {
      touching += full.step(1).touching_pairs;
      reduced.step(1);
      for (Eigen::Index v = 0; v < all.blocks.bar.model.object->mesh.vertex_count(); ++v)
        ASSERT_LT((fork.displacement(full.state(0), v) - all.displacement(reduced.state(0), v)).norm(), tolerance) << i;
    }
    EXPECT_GT(touching, 20);
  }
}

}  // namespace
}  // namespace exmat::runtime
