#include <Eigen/Geometry>
#include <array>
#include <cmath>
#include <gtest/gtest.h>

#include "runtime/sim/space/full/full_body.h"
#include "runtime/sim/world/world.h"
#include "tests/precompute/full_space/full_space_bar.h"
#include "tests/runtime/sim/world/touching_blocks.h"
#include "tests/support/full_collision.h"

// Bodies in full space that touch, beside a Runge-Kutta method in all vertices of both, which shares nothing with them
// but the law of contact, and beside bodies that step in all of their modes.
namespace exmat::precompute {
namespace full_bodies_test {

using runtime::FrameMotion;

test::BarOptions bar_options() {
  test::BarOptions options = runtime::test::Blocks::free_block();
  options.cells = {3, 1, 1};
  options.youngs_modulus = 2e5;
  return options;
}

const std::array<FrameMotion, 2> kHeadOn{
    FrameMotion{{0, 0, 0}, Eigen::Quaterniond::Identity(), {1, 0, 0}, {0, 0, 0}},
    FrameMotion{{0.42, 0.033, 0.027}, Eigen::Quaterniond::Identity(), {-1, 0, 0}, {0, 0, 0}}};
const std::array<FrameMotion, 2> kOblique{
    FrameMotion{{0, 0, 0}, Eigen::Quaterniond::Identity(), {1, 0.2, 0}, {0, 0, 2}},
    FrameMotion{{0.43, 0.06, 0.04},
                Eigen::Quaterniond(Eigen::AngleAxisd(0.5, Eigen::Vector3d(1, 2, 3).normalized())),
                {-1, 0, 0.1},
                {1, 0, 0}}};

/// Two bars of all modes that may touch, each in one of its spaces.
struct Meeting {
  Meeting(const std::array<Space, 2>& its_spaces, const runtime::ContactLaw& law, double time_step)
      : spaces(its_spaces), bar(complete_bar(bar_options())), world({}, law) {
    bar.model.contact = test::surface_contact(bar.model);
    model = std::move(runtime::build_model(bar.model, {}).model);
    full = std::move(runtime::build_full_model(bar.model, *model).model);
    const TetMesh& mesh = bar.model.object->mesh;
    surface = std::make_shared<runtime::TouchingSurface>(
        *model->contact,
        runtime::BodySurface::of_tets(mesh.tets, mesh.vertices, bar.model.modal->basis, model->frame->origin()));
    for (std::size_t i = 0; i < 2; ++i) {
      scenes[i].time_step = time_step;
      scenes[i].newton = scenes[i].space.newton = {200, 1e-8};
      scenes[i].space.space = spaces[i];
      scenes[i].gravity_force = Eigen::VectorXd::Zero(model->modes());
    }
  }

  void start(const std::array<FrameMotion, 2>& motions) {
    for (std::size_t i = 0; i < 2; ++i) {
      states[i] = runtime::make_state(*model);
      runtime::set_motion(*model, motions[i], states[i]);
      runtime::prepare_full(*full, states[i]);
      world.add({model.get(), &scenes[i], surface, full.get()}, states[i]);
    }
  }

  void run(int steps) {
    for (int i = 0; i < steps; ++i) {
      const runtime::WorldReport report = world.step(1);
      for (int k = 0; k < 2; ++k) ASSERT_EQ(world.report(k).status & runtime::kStepNonFinite, 0U) << i;
      // Without contacts, forces are those of rounding, which no solution is above.
      if (world.report(0).contacts > 0) unconverged += report.unconverged_islands;
      touching += report.touching_pairs;
    }
  }

  /// World positions and velocities of all vertices of one, interleaved.
  Eigen::VectorXd positions(std::size_t i) {
    runtime::State state = states[i];
    if (!state.full) runtime::enter_full_space(*full, *model, state);
    const VertexArray& rest = bar.model.object->mesh.vertices;
    Eigen::VectorXd all(rest.size());
    for (Eigen::Index v = 0; v < rest.rows(); ++v)
      all.segment<3>(3 * v) = rest.row(v).transpose() + state.full->q.segment<3>(3 * full->space.number(v));
    return all;
  }
  Eigen::VectorXd velocities(std::size_t i) {
    runtime::State state = states[i];
    if (!state.full) runtime::enter_full_space(*full, *model, state);
    return state.full->v;
  }

  /// Momentum of both, linear and about the origin.
  runtime::FrameMomenta momenta() const {
    runtime::FrameMomenta sum;
    for (const runtime::State& state : states) {
      const auto own = *model->frame->momenta(state.frame);
      sum.linear += own.linear;
      sum.angular += own.angular + model->frame->placement(state.frame).position.cross(own.linear);
    }
    return sum;
  }

  std::array<Space, 2> spaces;
  test::Bar bar;
  std::unique_ptr<const runtime::Model> model;
  std::unique_ptr<const runtime::FullModel> full;
  std::shared_ptr<const runtime::TouchingSurface> surface;
  std::array<runtime::StepScene, 2> scenes;
  std::array<runtime::State, 2> states;
  runtime::World world;
  int unconverged = 0, touching = 0;
};

using Case = std::tuple<std::array<Space, 2>, std::array<FrameMotion, 2>>;
class FullMeetings : public ::testing::TestWithParam<Case> {};

TEST_P(FullMeetings, MeetAsByRungeAndKuttaToTheOrderOfTheStep) {
  constexpr double kStiffness = 3e6, kTime = 0.06;  // the bars meet after 0.01 s and part after 0.04 s
  const auto& [spaces, motions] = GetParam();
  const auto collide = [&, spaces = spaces, motions = motions](double time_step, std::array<Eigen::VectorXd, 2>& x) {
    // A corner of the oblique one begins in the other, and the reference lets nothing out slowly.
    Meeting meeting(spaces, {.stiffness = kStiffness, .release = 1e9}, time_step);
    meeting.start(motions);
    const runtime::FrameMomenta before = meeting.momenta();
    meeting.run(static_cast<int>(std::lround(kTime / time_step)));
    EXPECT_GT(meeting.touching, 10);
    EXPECT_EQ(meeting.unconverged, 0);
    const runtime::FrameMomenta after = meeting.momenta();
    // Changes relative to the momentum of either.
    EXPECT_LE((after.linear - before.linear).norm(), 1e-11 * meeting.full->rigid->mass());
    EXPECT_LE((after.angular - before.angular).norm(), 1e-11 * meeting.full->rigid->mass());
    for (std::size_t i = 0; i < 2; ++i) x[i] = meeting.positions(i);
  };
  Meeting first(spaces, {}, 1e-4);
  first.start(motions);
  std::array<test::FullCollision::Motion, 2> starts;
  for (std::size_t i = 0; i < 2; ++i) starts[i] = {first.positions(i), first.velocities(i)};
  const auto end = test::FullCollision(first.bar, kStiffness).run(starts, kTime, 6000);
  double made = 0;
  for (std::size_t i = 0; i < 2; ++i) made += (end[i].x - starts[i].x - kTime * starts[i].v).squaredNorm();
  const auto error = [&](const std::array<Eigen::VectorXd, 2>& x) {
    return std::sqrt(((x[0] - end[0].x).squaredNorm() + (x[1] - end[1].x).squaredNorm()) / made);
  };
  std::array<Eigen::VectorXd, 2> coarse, fine;
  collide(1e-4, coarse);
  collide(5e-5, fine);
  RecordProperty("error", std::to_string(error(coarse)));
  // Backward Euler is of first order, with a contact that begins and ends in between.
  EXPECT_LE(error(coarse), 0.013);
  EXPECT_LE(error(fine), 0.65 * error(coarse));
}

// The harder one is pushed, and only one may be in full space; the other takes its place when it is let go.
TEST(FullBodies, AsManyAsMayStepInAllVerticesDo) {
  Meeting meeting({Space::kAuto, Space::kAuto}, {.stiffness = 3e6}, 1e-3);
  for (runtime::StepScene& scene : meeting.scenes) scene.space.release = 0.01;
  meeting.start(kHeadOn);
  meeting.world.set_full_bodies(1);
  const auto push = [&](std::size_t i, double force) {
    runtime::State& state = meeting.states[i];
    state.vertex_force.tail<3>() = Eigen::Vector3d(0, force, 0);
    state.applied_force = meeting.full->basis.transpose() * state.vertex_force;
  };
  const auto are_full = [&] {
    return std::pair(meeting.states[0].full.has_value(), meeting.states[1].full.has_value());
  };
  push(0, 1);
  push(1, 2);
  meeting.run(3);
  EXPECT_EQ(are_full(), std::pair(false, true));
  push(1, 0);
  meeting.run(3);
  EXPECT_EQ(are_full(), std::pair(true, false));
  meeting.world.set_full_bodies(2);
  push(1, 1);
  meeting.run(3);
  EXPECT_EQ(are_full(), std::pair(true, true));
  meeting.world.set_full_bodies(0);
  meeting.run(3);
  EXPECT_EQ(are_full(), std::pair(false, false));
}

INSTANTIATE_TEST_SUITE_P(Spaces, FullMeetings,
                         ::testing::Combine(::testing::Values(std::array{Space::kFull, Space::kFull},
                                                              std::array{Space::kFull, Space::kReduced},
                                                              std::array{Space::kReduced, Space::kFull}),
                                            ::testing::Values(kHeadOn, kOblique)));

}  // namespace full_bodies_test
}  // namespace exmat::precompute
