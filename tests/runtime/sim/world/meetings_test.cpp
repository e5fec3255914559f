#include "tests/runtime/sim/world/meetings.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "tests/runtime/sim/step/thrown_block.h"
#include "tests/support/random.h"

namespace exmat::runtime {
namespace {

using test::Meeting;
using test::Squeeze;

constexpr double kGain = 1e-6;  // BDF2 in free flight and the residuals of Newton's method

std::string name_of(const Meeting& meeting) {
  return fmt::format("E {:g} Pa, {:g} m/s, {:g} N/m^3, {:g} s, damped {}, body {}, start {}, {} in full space",
                     meeting.youngs_modulus, meeting.speed, meeting.stiffness, meeting.time_step, meeting.damped,
                     meeting.bodies, meeting.start, meeting.full);
}

/// Returns the number of steps that did not converge.
int expect_no_gain(const Meeting& meeting) {
  SCOPED_TRACE(name_of(meeting));
  const test::MeetingResult result = test::meet(test::meeting_blocks(meeting), meeting);
  EXPECT_LE(result.peak, 1 + kGain);
  EXPECT_EQ(result.non_finite, 0);
  EXPECT_LE(result.drift, 1e-9);
  return result.unconverged;
}

// The driver exmat-meetings takes all of them.
TEST(Meetings, NoneGainsEnergyOrEnds) {
  int unconverged = 0;
  for (const Meeting& meeting : test::some_meetings(60, 20261127)) unconverged += expect_no_gain(meeting);
  EXPECT_EQ(unconverged, 0);
}

TEST(Meetings, NoneGainsEnergyOrEndsInFullSpace) {
  for (Meeting& meeting : test::some_meetings(24, 20261128)) {
    meeting.full = 1;
    expect_no_gain(meeting);
    meeting.full = 2;
    expect_no_gain(meeting);
  }
}

// Before contacts had an account these ended with up to ten million times their energy.
TEST(Meetings, NoneOfThoseThatGainedDoes) {
  for (const Meeting& meeting : {Meeting{1e3, 20, 1e9, 1.0 / 60, false, 1, 1},
                                 {1e3, 2, 1e8, 1.0 / 60, false, 0, 1},
                                 {1e4, 5, 1e9, 1.0 / 60, false, 1, 2},
                                 {1e4, 50, 1e8, 1.0 / 60, false, 1, 1},
                                 {1e3, 50, 1e9, 1.0 / 60, true, 1, 1}})
    for (const double share : {1.0, 0.25}) {
      Meeting finer = meeting;
      finer.time_step *= share;
      expect_no_gain(finer);
    }
}

// It ended with 1.09 times its energy: an obstacle near by, which pushes nothing, is no reason to leave it that.
TEST(Meetings, NoneGainsEnergyBesideAnObstacle) {
  const Meeting meeting{1e3, 50, 1e9, 1.0 / 60, true, 1, 2};
  test::FullBlocks blocks = test::meeting_blocks(meeting);
  blocks.scene.obstacles.push_back(Obstacle{Plane{{0, 0, -2}, Eigen::Vector3d::UnitZ()}, RigidMotion(), 1e6, 0, 0});
  EXPECT_LE(test::meet(blocks, meeting).peak, 1 + kGain);
}

/// Obstacles that stand still in the way of a body that begins at the origin and flies along x.
std::vector<Shape> obstacles_in_the_way() {
  const Eigen::Vector3d ahead(2.2, 0.5, 0.5);
  const Eigen::Matrix3d turn = Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, -2, 0.5).normalized()).toRotationMatrix();
  const Box plate{ahead, {0.06, 0.9, 0.8}, turn};
  RowMatrix heights(8, 8);
  for (Eigen::Index i = 0; i < heights.size(); ++i) heights.data()[i] = 0.2 * std::abs(std::sin(7.0 * i * i));
  Eigen::Matrix3d sideways;
  sideways << 0, 0, -1, 0, 1, 0, 1, 0, 0;
  return {Sphere{ahead, 0.4},
          Box{ahead, {0.5, 0.3, 0.2}, turn},
          plate,
          test::mesh_of_box(plate, 2),
          test::mesh_of_box({ahead, {0.4, 0.3, 0.5}, turn}, 2, 0.1),
          HeightFieldShape{std::make_shared<HeightField>(heights, Eigen::Vector2d(0.4, 0.4)), {2.2, -1, -1}, sideways}};
}

// Vertices that a step brought deep held springs that nobody had paid for, and vertices on their way back out of one
// did: up to six times the energy.
TEST(Meetings, ABodyGainsNoEnergyFromObstaclesThatStand) {
  for (int full = 0; full < 2; ++full) {
    std::uint32_t seed = 0;
    for (const Meeting& meeting : test::some_meetings(full == 0 ? 160 : 80, 20261201)) {
      ++seed;
      SCOPED_TRACE(testing::Message() << name_of(meeting) << " run " << seed << ", full " << full);
      test::FullBlocks blocks = test::meeting_blocks(meeting);
      const std::vector<Shape> shapes = obstacles_in_the_way();
      const ContactLaw law = test::law_of(meeting);
      blocks.scene.obstacles.push_back(
          Obstacle{shapes[seed % shapes.size()], RigidMotion(), law.stiffness, law.damping, law.friction});
      blocks.full_scene.obstacles = blocks.scene.obstacles;
      const Eigen::VectorXd chosen = test::random_vector(7, seed);
      std::vector<WorldBodyStart> bodies{blocks.body({0, 0, 0}, {meeting.speed, 0, 0},
                                                     (full > 0 ? 0 : 5) * chosen.head<3>(),
                                                     Eigen::Quaterniond(chosen.tail<4>()).normalized())};
      if (full > 0) blocks.put_in_full_space(bodies.front());
      World world(std::move(bodies), law);
      const double start = world.energies().total();
      const int steps = std::clamp(static_cast<int>(4 / (meeting.speed * meeting.time_step)), 20, 200);
      for (int i = 0; i < steps; ++i) {
        world.step(1);
        const double energy = world.energies().total();
        if (world.report(0).status & kStepIterationLimit) continue;
        ASSERT_LE(energy, (1 + kGain) * start) << "step " << i;
      }
    }
  }
}

// One ended with 18 times its energy, the other with 13 million times: of a step without a solution the deformation
// alone had more than there was.
TEST(Meetings, NoneGainsEnergyPressedAgainstAnObstacle) {
  for (const Squeeze& squeeze :
       {Squeeze{{{{0.8074, 0.068, 0.127}, {1.6194, 0.138, -0.081}, {2.7584, -0.707, -0.701}}}, 10, 4.08e7, 2.18e8},
        Squeeze{{{{0.7765, -0.232, -0.139}, {1.5985, -0.24, 0.008}, {2.7265, -0.798, -0.569}}}, 10, 8.92e6, 1.08e8}})
    EXPECT_LE(test::peak_of(squeeze), 1 + kGain) << squeeze.plane_stiffness << " N/m^3";
}

TEST(Meetings, GoOnFromTheirMemoryToTheLastBit) {
  for (const int full : {0, 1, 2}) {
    const Meeting meeting{1e4, 5, 1e9, 1.0 / 60, true, 1, 2, full};
    const test::FullBlocks blocks = test::meeting_blocks(meeting);
    World world = test::meeting_world(blocks, meeting);
    for (int i = 0; i < 8; ++i) world.step(1);
    ASSERT_EQ(world.held().size(), 1U);
    EXPECT_GT(world.held().front().account, 0);
    World other = test::meeting_world(blocks, meeting);
    for (int i = 0; i < 2; ++i) other.state(i) = world.state(i);
    other.set_memory(world.held());
    EXPECT_EQ(other.energies().total(), world.energies().total());
    for (int i = 0; i < 20; ++i) {
      world.step(1);
      other.step(2);
    }
    for (int i = 0; i < 2; ++i) {
      EXPECT_EQ(world.state(i).q, other.state(i).q);
      EXPECT_EQ(free_state(world.state(i)).position, free_state(other.state(i)).position);
      if (i < full) {
        EXPECT_EQ(world.state(i).full->q, other.state(i).full->q);
      }
    }
  }
}

// Soft bodies that fall upon each other and upon the floor, where obstacles and gravity act, too.
TEST(Meetings, APileOfSoftBodiesGainsNoEnergy) {
  for (const double stiffness : {1e7, 1e9}) {
    test::Blocks blocks = test::meeting_blocks({3e3, 0, stiffness, 1.0 / 60, false, 1, 0});
    blocks.set_gravity(9.81);
    blocks.add_floor(1e7, 0.3, 1e4);
    std::vector<WorldBodyStart> bodies;
    for (int i = 0; i < 5; ++i)
      bodies.push_back(blocks.body({0.1 * (i % 2), 0.07 * (i % 3), 0.1 + 0.6 * i}, {0, 0, -2.0 - 2 * i}));
    World world(std::move(bodies), {stiffness, stiffness / 1e3, 0.3});
    const double start = world.energies().total(), kinetic = world.energies().kinetic;
    for (int i = 0; i < 200; ++i) {
      world.step(1);
      ASSERT_LE(world.energies().total(), start + kGain * kinetic) << i << ", " << stiffness << " N/m^3";
    }
  }
}

// Whatever they are given, a step is finite or says that it is not.
TEST(Meetings, WhatOverflowsIsReported) {
  for (const double speed : {1e10, 1e150, 1e306, 1e308})
    for (const auto& [stiffness, full] : {std::pair(5e-324, 0), std::pair(1e7, 0), std::pair(1e300, 0),
                                          std::pair(5e-324, 2), std::pair(1e7, 1), std::pair(1e300, 3)}) {
      SCOPED_TRACE(testing::Message() << speed << " m/s, " << stiffness << " N/m^3, " << full << " in full space");
      const test::FullBlocks blocks(1e-3, test::Blocks::free_block());
      std::vector<WorldBodyStart> bodies{blocks.body({0, 0, 0}, {speed, 0, 0}), blocks.body({0.45, 0.02, 0}),
                                         blocks.body({0, 0.15, 0.05})};
      for (int i = 0; i < full; ++i) blocks.put_in_full_space(bodies[static_cast<std::size_t>(i)]);
      World world(std::move(bodies), {stiffness, 0, 0.5});
      for (int i = 0; i < 3; ++i) {
        world.step(1);
        for (int body = 0; body < world.count(); ++body) {
          if ((world.report(body).status & kStepNonFinite) != 0) continue;
          const FreeState& there = free_state(world.state(body));
          EXPECT_TRUE(world.state(body).q.allFinite() && world.state(body).v.allFinite()) << body;
          EXPECT_TRUE(there.position.allFinite() && there.angular_momentum.allFinite()) << body;
        }
        for (const HeldPair& pair : world.held()) {
          EXPECT_TRUE(std::isfinite(pair.energy) && std::isfinite(pair.account));
          for (const auto& side : pair.held)
            for (const HeldBodyContact& contact : side)
              EXPECT_TRUE(contact.stretch.allFinite() && contact.normal.allFinite() && std::isfinite(contact.gap));
        }
      }
    }
}

}  // namespace
}  // namespace exmat::runtime
