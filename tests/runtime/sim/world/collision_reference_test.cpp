#include <gtest/gtest.h>

#include "tests/runtime/sim/world/touching_blocks.h"
#include "tests/support/full_collision.h"

namespace exmat::runtime {
namespace {

using exmat::test::FullCollision;
using test::Blocks;

constexpr double kStiffness = 3e6;  // [N/m^3]
constexpr double kTime = 0.06;      // the bars meet after 0.01 s and part after 0.04 s [s]

struct Start {
  std::array<FrameMotion, 2> motions;
};

/// The second off centre, so that its corners are told apart from the sides of the first.
Start head_on() {
  return {{FrameMotion{{0, 0, 0}, Eigen::Quaterniond::Identity(), {1, 0, 0}, {0, 0, 0}},
           FrameMotion{{0.42, 0.033, 0.027}, Eigen::Quaterniond::Identity(), {-1, 0, 0}, {0, 0, 0}}}};
}
Start oblique() {
  const Eigen::Quaterniond turn(Eigen::AngleAxisd(0.5, Eigen::Vector3d(1, 2, 3).normalized()));
  return {{FrameMotion{{0, 0, 0}, Eigen::Quaterniond::Identity(), {1, 0.2, 0}, {0, 0, 2}},
           FrameMotion{{0.43, 0.06, 0.04}, turn, {-1, 0, 0.1}, {1, 0, 0}}}};
}

exmat::test::BarOptions bar_options(int linear_modes) {
  exmat::test::BarOptions options = Blocks::free_block();
  options.cells = {3, 1, 1};
  options.youngs_modulus = 2e5;
  options.linear_modes = linear_modes;
  return options;
}

Eigen::VectorXd positions(const Blocks& blocks, const State& state) {
  const Placement placement = blocks.model->frame->placement(state.frame);
  const Eigen::VectorXd rest = blocks.bar.model.object->mesh.vertices.reshaped<Eigen::RowMajor>();
  const Eigen::VectorXd moved = rest + blocks.bar.basis() * state.q;
  Eigen::VectorXd world(moved.size());
  for (Eigen::Index i = 0; i < moved.size(); i += 3) world.segment<3>(i) = placement.to_world(moved.segment<3>(i));
  return world;
}

FullCollision::Motion motion_of(const Blocks& blocks, const FrameMotion& motion) {
  const State state = blocks.body(motion).state;
  FullCollision::Motion full{positions(blocks, state), Eigen::VectorXd(blocks.bar.mass.rows())};
  const Eigen::Vector3d centre = blocks.centre(state);
  for (Eigen::Index i = 0; i < full.x.size(); i += 3)
    full.v.segment<3>(i) =
        motion.linear_velocity + motion.angular_velocity.cross(Eigen::Vector3d(full.x.segment<3>(i) - centre));
  return full;
}

/// Positions of both at the end.
Eigen::VectorXd collide(const Start& start, int linear_modes, double time_step) {
  const Blocks blocks(time_step, bar_options(linear_modes));
  // A corner of the oblique one begins in the other, and the reference lets nothing out slowly.
  const ContactLaw law{.stiffness = kStiffness, .release = 1e9};
  World world({blocks.body(start.motions[0]), blocks.body(start.motions[1])}, law);
  const int steps = static_cast<int>(std::lround(kTime / time_step));
  int touching = 0;
  for (int i = 0; i < steps; ++i) {
    const WorldReport report = world.step(1);
    EXPECT_EQ(report.unconverged_islands, 0) << i;
    touching += report.touching_pairs;
  }
  EXPECT_GT(touching, 0);
  Eigen::VectorXd both(2 * blocks.bar.mass.rows());
  both << positions(blocks, world.state(0)), positions(blocks, world.state(1));
  return both;
}

class CollisionReference : public ::testing::TestWithParam<Start> {};

TEST_P(CollisionReference, BodiesOfAllModesCollideAsTheFullSpaceDoes) {
  const Start& start = GetParam();
  const auto options = bar_options(0);
  const int all = 3 * (options.cells[0] + 1) * (options.cells[1] + 1) * (options.cells[2] + 1) - 6;
  const Blocks blocks(1e-3, bar_options(all));
  const FullCollision full(blocks.bar, kStiffness);
  const auto end = full.run({motion_of(blocks, start.motions[0]), motion_of(blocks, start.motions[1])}, kTime, 6000);
  const Eigen::Index size = end[0].x.size();
  Eigen::VectorXd expected(2 * size), flown(2 * size);
  expected << end[0].x, end[1].x;
  for (int k = 0; k < 2; ++k) {
    FullCollision::Motion free = motion_of(blocks, start.motions[static_cast<std::size_t>(k)]);
    flown.segment(k * size, size) = free.x + kTime * free.v;
  }
  // Change of the motion by the collision.
  const double made = (expected - flown).norm();
  const auto error = [&](const Eigen::VectorXd& found) { return (found - expected).norm() / made; };
  // Backward Euler is of first order, with a contact that begins and ends in between; the rest is 6,000 steps of the
  // reference and of the normals that a step keeps.
  const Eigen::VectorXd coarse = collide(start, all, 1e-4), fine = collide(start, all, 5e-5);
  EXPECT_LE(error(coarse), 0.013);
  EXPECT_LE(error(fine), 0.65 * error(coarse));
  EXPECT_LE(error(2 * fine - coarse), 0.006);
  // Fewer modes, larger errors.
  double last = 1;
  for (const int modes : {12, 24, 36}) {
    const double reduced = error(collide(start, modes, 1e-4));
    RecordProperty("r" + std::to_string(modes), std::to_string(reduced));
    EXPECT_LE(reduced, last);
    last = reduced;
  }
  EXPECT_LE(last, 0.09);
}

INSTANTIATE_TEST_SUITE_P(Starts, CollisionReference, ::testing::Values(head_on(), oblique()));

}  // namespace
}  // namespace exmat::runtime
