#include <algorithm>
#include <gtest/gtest.h>

#include "tests/runtime/sim/world/touching_blocks.h"

namespace exmat::runtime {
namespace {

using test::Blocks;

/// A bar with two prongs, 0.08 m apart.
exmat::test::BarOptions fork(bool free) {
  return {.cells = {8, 2, 3},
          .lengths = {0.64, 0.16, 0.24},
          .youngs_modulus = 1e5,
          .free = free,
          .slot_start = 2,
          .linear_modes = 12};
}

/// A fork in a world of its own.
struct Fork {
  Fork(double time_step, bool free, bool meets_itself) : blocks(time_step, fork(free), meets_itself) {
    const VertexArray& rest = blocks.bar.model.object->mesh.vertices;
    const double length = rest.col(0).maxCoeff();
    for (Eigen::Index v = 0; v < rest.rows(); ++v) {
      if (rest(v, 0) < length - 1e-9) continue;
      if (std::abs(rest(v, 2) - 0.08) < 1e-9) below.push_back(v);
      if (std::abs(rest(v, 2) - 0.16) < 1e-9) above.push_back(v);
    }
    // The mode that brings the ends of the prongs together most.
    Eigen::Index best = 0;
    for (Eigen::Index j = 0; j < blocks.model->modes(); ++j)
      if (std::abs(closing(j)) > std::abs(closing(best))) best = j;
    mode = best;
  }

  double closing(Eigen::Index j) const {
    return blocks.bar.basis()(3 * below.front() + 2, j) - blocks.bar.basis()(3 * above.front() + 2, j);
  }
  /// Of the ends of the prongs, negative where they overlap [m].
  double gap(const Eigen::VectorXd& q) const {
    double sum = 0.08;
    for (Eigen::Index j = 0; j < q.size(); ++j) sum -= closing(j) * q[j];
    return sum;
  }
  /// At a gap [m] that closes at a speed [m/s].
  WorldBodyStart closed_to(double gap, double speed, const Eigen::Vector3d& spin = Eigen::Vector3d::Zero()) const {
    const Eigen::VectorXd closed = Eigen::VectorXd::Unit(blocks.model->modes(), mode) / closing(mode);
    State state = make_state(*blocks.model, (0.08 - gap) * closed, speed * closed);
    set_motion(*blocks.model, {.angular_velocity = spin}, state);
    return {{blocks.model.get(), &blocks.scene, blocks.surface}, std::move(state)};
  }

  Blocks blocks;
  std::vector<Eigen::Index> below, above;
  Eigen::Index mode = 0;
};

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
  for (const double time_step : {2e-4, 2e-3}) {
    const Fork fork(time_step, true, true);
    World world({fork.closed_to(0.03, 3.0, {1, 4, 2})}, {1e8, 1e4, 0.4});
    const test::Momenta before = test::momenta(fork.blocks, world);
    const double start = world.energies().total();
    int touching = 0;
    for (int i = 0; i < static_cast<int>(0.1 / time_step); ++i) {
      const WorldReport report = world.step(1);
      ASSERT_EQ(report.unconverged_islands, 0);
      touching += report.touching_pairs;
      const test::Momenta now = test::momenta(fork.blocks, world);
      ASSERT_LE((now.linear - before.linear).norm(), 1e-12 * fork.blocks.mass() * 3);
      ASSERT_LE((now.angular - before.angular).norm(), 1e-12 * fork.blocks.mass() * 3);
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
