#include <gtest/gtest.h>

#include "tests/runtime/sim/world/held_vertex.h"
#include "tests/runtime/sim/world/meetings.h"

// Steps of bodies that touch which have no solution, and are taken in several smaller ones.
namespace exmat::runtime {
namespace divided_step_test {

using test::Meeting;

constexpr int kParts = 4;

/// Two bars that fly into each other flush, each by five sixths of its length in a step.
constexpr Meeting kFlush{3e3, 50, 1e6, 1.0 / 60, false, 1, 0};
/// The same beside each other, with friction and damping.
constexpr Meeting kBeside{3e3, 50, 1e8, 1.0 / 60, true, 1, 1};

Meeting in_parts(Meeting meeting) {
  meeting.time_step /= kParts;
  return meeting;
}

/// A spring at a corner of the first, whose frame its host moves by `way` in a step.
void hold_corner(const test::FullBlocks& blocks, const Eigen::Vector3d& way, World& world) {
  State& state = world.state(0);
  state.attachments.push_back(test::held_vertex(*blocks.model, blocks.bar, state, 0, AttachmentKind::kSpring));
  state.attachments[0].stiffness = 2e4;
  state.attachments[0].damping = 50;
  state.attachments[0].position = way;
  world.fit_attachments(0);
}

void expect_near(const Eigen::VectorXd& a, const Eigen::VectorXd& b) {
  EXPECT_LE((a - b).norm(), 1e-9 * b.norm());  // sums in another order, through Newton's tolerance
}

void expect_same(const World& divided, const World& parts) {
  for (int i = 0; i < 2; ++i) {
    const State &a = divided.state(i), &b = parts.state(i);
    expect_near(a.q, b.q);
    expect_near(a.v, b.v);
    expect_near(free_state(a).position, free_state(b).position);
    expect_near(free_state(a).linear_momentum, free_state(b).linear_momentum);
    expect_near(free_state(a).angular_momentum, free_state(b).angular_momentum);
  }
  EXPECT_NEAR(divided.energies().total(), parts.energies().total(), 1e-9 * parts.energies().total());
}

// A step of 1/60 s in four parts is four steps of 1/240 s, with what they remember of their contacts.
TEST(DividedSteps, AreAsManySmallerSteps) {
  for (const Meeting& meeting : {kFlush, kBeside}) {
    const test::FullBlocks blocks = test::meeting_blocks(meeting), finer = test::meeting_blocks(in_parts(meeting));
    World world = test::meeting_world(blocks, meeting), parts = test::meeting_world(finer, in_parts(meeting));
    const WorldReport report = world.step(1);
    ASSERT_EQ(report.divided_islands, 1);
    EXPECT_EQ(report.unconverged_islands, 0);
    int iterations = 0;
    for (int part = 0; part < kParts; ++part) {
      const WorldReport own = parts.step(1);
      EXPECT_EQ(own.unconverged_islands + own.divided_islands, 0);
      iterations += own.newton_iterations;
    }
    expect_same(world, parts);
    EXPECT_EQ(world.report(0).status, kStepDivided);
    EXPECT_EQ(world.report(1).newton_iterations, iterations);
    EXPECT_EQ(world.state(0).step, 1);
    EXPECT_EQ(world.state(0).time, meeting.time_step);
  }
}

// The frame is a fourth of its way farther in each part.
TEST(DividedSteps, TakeFramesOfAHostAlong) {
  const test::FullBlocks blocks = test::meeting_blocks(kFlush), finer = test::meeting_blocks(in_parts(kFlush));
  World world = test::meeting_world(blocks, kFlush), parts = test::meeting_world(finer, in_parts(kFlush));
  const Eigen::Vector3d way(0.1, 0.2, -0.05);
  hold_corner(blocks, way, world);
  hold_corner(finer, way / kParts, parts);
  ASSERT_EQ(world.step(1).divided_islands, 1);
  for (int part = 1; part <= kParts; ++part) {
    parts.state(0).attachments[0].position = part * way / kParts;
    ASSERT_EQ(parts.step(1).divided_islands, 0);
  }
  expect_same(world, parts);
  const Attachment &own = world.state(0).attachments[0], &other = parts.state(0).attachments[0];
  EXPECT_EQ(own.position, way);
  EXPECT_EQ(own.position_before, way);
  expect_near(own.force, other.force);
}

/// Soft blocks that fall on a hard floor by five sixths of their length in a step.
std::vector<WorldBodyStart> fallen(const test::Blocks& blocks, int count) {
  std::vector<WorldBodyStart> bodies;
  for (int i = 0; i < count; ++i)
    bodies.push_back(blocks.body({3.0 * i, 0, 0.5}, {15, 0, -50}, {0, 0, 0},
                                 Eigen::Quaterniond(Eigen::AngleAxisd(0.6, Eigen::Vector3d(1, 2, 0.5).normalized()))));
  for (WorldBodyStart& body : bodies) body.kind.surface = nullptr;
  return bodies;
}

test::Blocks falling_blocks(double time_step) {
  exmat::test::BarOptions options = test::kMeetingBodies[0];
  options.youngs_modulus = 1e3;
  test::Blocks blocks(time_step, options);
  blocks.set_gravity(9.81);
  blocks.add_floor(1e8, 0, 0);
  return blocks;
}

// Side by side in lanes, too.
TEST(DividedSteps, AreTakenBySingleBodies) {
  for (const int count : {1, 8}) {
    const test::Blocks blocks = falling_blocks(1.0 / 60), finer = falling_blocks(1.0 / 60 / kParts);
    World world(fallen(blocks, count), {}), parts(fallen(finer, count), {});
    int divided = 0;
    for (int i = 0; i < 20; ++i) {
      for (int body = 0; body < count; ++body) parts.state(body) = world.state(body);
      for (int body = 0; body < count; ++body) parts.state(body).step *= kParts;
      parts.take_states();
      world.step(1);
      std::uint32_t unsolved = 0;
      for (int part = 0; part < kParts; ++part) {
        parts.step(1);
        unsolved |= parts.report(0).status;
      }
      ASSERT_EQ(world.report(0).status & ~kStepDivided, 0U) << i;
      if (world.report(0).status == 0 || unsolved != 0) continue;
      ++divided;
      for (int body = 0; body < count; ++body) {
        expect_near(world.state(body).q, parts.state(body).q);
        expect_near(world.state(body).v, parts.state(body).v);
        expect_near(free_state(world.state(body)).position, free_state(parts.state(body)).position);
      }
    }
    EXPECT_GT(divided, 0) << count;
  }
}

// Whoever bounds the iterations has no time for more of them.
TEST(DividedSteps, AreNotTakenWhereIterationsAreBounded) {
  test::FullBlocks blocks = test::meeting_blocks(kFlush);
  blocks.scene.newton.max_iterations = NewtonSettings{}.max_iterations - 1;
  World world = test::meeting_world(blocks, kFlush);
  const WorldReport report = world.step(1);
  EXPECT_EQ(report.divided_islands, 0);
  EXPECT_EQ(report.unconverged_islands, 1);
  EXPECT_NE(world.report(0).status & kStepUnconverged, 0U);
}

}  // namespace divided_step_test
}  // namespace exmat::runtime
