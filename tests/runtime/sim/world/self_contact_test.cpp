#include <algorithm>
#include <gtest/gtest.h>

#include "tests/runtime/sim/world/fork.h"

namespace exmat::runtime {
namespace {

using test::Fork;

TEST(SelfContact, ProngsThatCloseStopAtEachOther) {
  for (const double time_step : {2e-4, 1e-3, 4e-3})
    for (const double stiffness : {1e7, 1e9}) {
      SCOPED_TRACE(testing::Message() << time_step << " s, " << stiffness << " N/m^3");
      double smallest[2] = {1, 1};
      for (const bool meets_itself : {false, true}) {
        const Fork fork(time_step, false, meets_itself);
        World world({fork.closed_to(0.02, 10.0)}, {stiffness, stiffness / 1e4, 0.3});
        const double start = world.energies().total();
        int touching = 0;
        for (int i = 0; i < static_cast<int>(0.2 / time_step); ++i) {
          const WorldReport report = world.step(1);
          ASSERT_EQ(report.unconverged_islands, 0) << i;
          touching += report.touching_pairs;
          ASSERT_LE(world.energies().total(), start * (1 + 1e-9)) << i;
          smallest[meets_itself ? 1 : 0] = std::min(smallest[meets_itself ? 1 : 0], fork.gap(world.state(0).q));
        }
        EXPECT_EQ(touching > 0, meets_itself);
      }
      EXPECT_LT(smallest[0], -0.01);
      // Half of a prong, 3 kg, stopped from 10 m/s by a pressure of k depth on half a cell at its end at least, 0.0064
      // m^2.
      EXPECT_GT(smallest[1], -10 * std::sqrt(3 / (stiffness * 0.0064)));
    }
}

TEST(SelfContact, AFreeBodyKeepsItsMomenta) {
  constexpr double kSpeed = 10;  // [m/s]: at 3 the prongs turn round before they meet
  for (const double time_step : {2e-4, 2e-3}) {
    const Fork fork(time_step, true, true);
    World world({fork.closed_to(0.02, kSpeed, {1, 4, 2})}, {1e8, 1e4, 0.4});
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

TEST(SelfContact, WhatOverlapsAtTheStartNeverPushes) {
  const Fork fork(1e-3, false, true);
  // The other law has no force to speak of.
  World soft({fork.closed_to(-0.02, 0)}, {1e-12, 0, 0}), hard({fork.closed_to(-0.02, 0)}, {1e8, 1e4, 0.3});
  for (int i = 0; fork.gap(soft.state(0).q) < -1e-3; ++i) {
    ASSERT_LT(i, 200);
    soft.step(1);
    hard.step(1);
    EXPECT_TRUE(hard.held().empty() || hard.held()[0].held[0].empty());
    ASSERT_EQ(hard.state(0).q, soft.state(0).q) << i;
  }
}

TEST(SelfContact, ABodyAtRestTakesTheStepOfASingleBody) {
  const Fork plain(1e-3, true, false), fork(1e-3, true, true);
  World without({plain.closed_to(0.075, 0.05)}, {1e8, 1e4, 0.3}), with({fork.closed_to(0.075, 0.05)}, {1e8, 1e4, 0.3});
  for (int i = 0; i < 50; ++i) {
    without.step(1);
    EXPECT_EQ(with.step(1).islands, 0);
    ASSERT_EQ(with.state(0).q, without.state(0).q);
  }
}

}  // namespace
}  // namespace exmat::runtime
