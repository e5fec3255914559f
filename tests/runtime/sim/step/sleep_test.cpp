#include "runtime/sim/step/sleep.h"

#include <functional>
#include <gtest/gtest.h>

#include "runtime/scene/bodies.h"
#include "runtime/sim/lanes/lane_step.h"
#include "runtime/sim/world/world.h"
#include "tests/support/allocation_counter.h"
#include "tests/support/scenes.h"

// Bodies that rest are left alone until something acts on them.

namespace exmat::runtime {
namespace {

constexpr double kEnergy = 1e-9;  // of some 1e-2 J that swing

StepScene hanging(const Model& model) {
  StepScene scene = free_scene(model, Integrator::kBdf2, 0.01);
  scene.mass_damping = 8;
  scene.stiffness_damping = 0.02;
  scene.gravity = Eigen::Vector3d(0, 0, -2);
  scene.gravity_force = gravity_force(model, scene.gravity);
  scene.sleep = {kEnergy, 0.2};
  return scene;
}

struct Hanging {
  explicit Hanging(const test::BarOptions& options = {}) : bar(test::make_bar(options)) {
    if (options.free || options.carried) bar.model.contact = test::surface_contact(bar.model);
    model = prepared(bar);
    scene = hanging(*model);
    if (!model->examples.empty()) scene.examples = {ExampleSettings{50, 2, 0.5}};
    state = make_state(*model);
  }

  StepReport step() {
    if (!workspace) workspace.emplace(*model, scene);
    return runtime::step(*model, scene, state, *workspace);
  }
  /// True if it is asleep after at most so many steps.
  bool rests_within(int steps) {
    for (int n = 0; n < steps && !state.sleep.asleep; ++n) step();
    return state.sleep.asleep;
  }

  test::Bar bar;
  std::unique_ptr<const Model> model;
  StepScene scene;
  State state;
  std::optional<Workspace> workspace;
};

// Sleep changes no more than the energy allows: beside the body that never sleeps.
TEST(Sleep, ABodyAtRestStaysWhereItIs) {
  for (const int examples : {0, 3}) {
    Hanging body({.examples = examples}), awake({.examples = examples});
    awake.scene.sleep = {};
    ASSERT_TRUE(body.rests_within(2000));
    EXPECT_GT(body.state.step, 25);
    EXPECT_EQ(body.state.v.norm(), 0);
    const State at_rest = body.state;
    for (int n = 0; n < 300; ++n) {
      const StepReport report = body.step();
      EXPECT_EQ(report.status, kStepAsleep);
      EXPECT_EQ(report.newton_iterations, 0);
    }
    EXPECT_EQ(body.state.q, at_rest.q);
    EXPECT_EQ(body.state.step, at_rest.step + 300);
    EXPECT_DOUBLE_EQ(body.state.time, 0.01 * static_cast<double>(body.state.step));
    while (awake.state.step < body.state.step) EXPECT_EQ(awake.step().status & kStepAsleep, 0U);
    EXPECT_GT(awake.state.q.norm(), 0);
    EXPECT_LE((awake.state.q - body.state.q).norm(), 1e-3 * awake.state.q.norm());
  }
}

// At a turning point a body is still for a moment alone.
TEST(Sleep, ABodyThatSwingsIsAwake) {
  Hanging body;
  body.scene.mass_damping = body.scene.stiffness_damping = 0;
  body.scene.integrator = Integrator::kNewmark;
  EXPECT_FALSE(body.rests_within(1000));
  Hanging off;
  off.scene.sleep = {};
  EXPECT_FALSE(off.rests_within(2000));
  EXPECT_EQ(off.state.sleep.loads, 0U);
}

struct Event {
  std::string name;
  std::function<void(Hanging&)> happen;
};

TEST(Sleep, WhatActsOnABodyWakesIt) {
  const std::vector<Event> events{
      {"force of the host", [](Hanging& body) { body.state.applied_force[0] += 0.1; }},
      {"gravity", [](Hanging& body) { body.scene.gravity[2] = -2.5; }},
      {"load", [](Hanging& body) { body.scene.gravity_force[1] += 0.1; }},
      {"stiffness", [](Hanging& body) { body.scene.examples.front().stiffness = 60; }},
      {"bias", [](Hanging& body) { body.scene.examples.front().bias = 0.4; }},
      {"weights", [](Hanging& body) { body.scene.examples.front().given_weights = Eigen::Vector3d(0, 1, 0); }},
      {"a jump", [](Hanging& body) { body.scene.begins_anew = true; }},
      {"a state that was set", [](Hanging& body) { body.state.begins_anew = true; }},
      {"the setting", [](Hanging& body) { body.scene.sleep = {}; }},
      {"a call", [](Hanging& body) { wake(body.state); }}};
  Hanging rested({.examples = 3});
  ASSERT_TRUE(rested.rests_within(2000));
  const State asleep = rested.state;
  const StepScene scene = rested.scene;
  for (const Event& event : events) {
    rested.state = asleep;
    rested.scene = scene;
    EXPECT_EQ(rested.step().status, kStepAsleep) << event.name;
    event.happen(rested);
    EXPECT_FALSE(sleeps(*rested.model, rested.scene, rested.state)) << event.name;
    EXPECT_TRUE(rested.state.begins_anew) << event.name;
    EXPECT_EQ(rested.state.sleep.still_steps, 0) << event.name;
  }
  rested.state = asleep;
  rested.scene = scene;
  rested.state.applied_force[0] += 0.1;
  EXPECT_GT(rested.step().newton_iterations, 0);
  EXPECT_GT(rested.state.v.norm(), 0);
}

TEST(Sleep, AForceThatBeginsOrEndsWakes) {
  Hanging body;
  ScriptedForce force;
  force.force = Eigen::VectorXd::Unit(body.model->modes(), 0);
  force.start = 30;
  force.end = 30.5;
  body.scene.forces = {force};
  ASSERT_TRUE(body.rests_within(2500));
  ASSERT_LT(body.state.time, 29);
  while (body.state.sleep.asleep && body.state.time < 40) body.step();
  EXPECT_NEAR(body.state.time, 30, 0.011);
  EXPECT_GT(body.state.v.norm(), 0);
  EXPECT_TRUE(body.rests_within(3000)) << "it comes to rest again";
}

/// A free bar that has come to lie on the ground, and a ball of 0.1 m.
Hanging lying() {
  Hanging body({.free = true});
  Obstacle floor;
  floor.shape = Plane{Eigen::Vector3d(0, 0, -0.01), Eigen::Vector3d::UnitZ()};
  floor.stiffness = 1e6;
  floor.damping = 1e3;
  floor.friction = 0.5;
  Obstacle ball;
  ball.shape = Sphere{Eigen::Vector3d::Zero(), 0.1};
  ball.stiffness = 1e6;
  MotionSample far;
  far.position = Eigen::Vector3d(0.5, 0, 50);
  far.linear_velocity = Eigen::Vector3d(0, 0, -1);
  ball.motion = RigidMotion::going_on(0, far);
  body.scene.obstacles = {floor, ball};
  body.scene.gravity = Eigen::Vector3d(0, 0, -9.81);
  body.scene.gravity_force = gravity_force(*body.model, body.scene.gravity);
  body.scene.sleep = {1e-5, 0.2};
  prepare_contacts(*body.model, 2, body.state);
  return body;
}

TEST(Sleep, AnObstacleWakesWhenItComesNear) {
  Hanging body = lying();
  ASSERT_TRUE(body.rests_within(3000));
  ASSERT_LT(body.state.time, 45);
  EXPECT_EQ(free_state(body.state).linear_momentum.norm(), 0);
  EXPECT_EQ(free_state(body.state).angular_momentum.norm(), 0);
  EXPECT_GT(body.state.contacts.count, 0U);
  while (body.state.sleep.asleep && body.state.time < 60) body.step();
  EXPECT_GT(body.state.time, 47);
  EXPECT_LT(body.state.time, 50);
  double most = 0;
  while (body.state.time < 51) {
    body.step();
    most = std::max(most, body.model->frame->kinetic_energy(body.state.v, body.state.frame));
  }
  EXPECT_GT(most, 1e-3) << "the ball has struck";
}

TEST(Sleep, AFreeBodyWakesByItsForcesAndTorques) {
  Hanging body = lying();
  ASSERT_TRUE(body.rests_within(3000));
  const State asleep = body.state;
  body.model->frame->apply(Eigen::Vector3d(0, 0, 1), Eigen::Vector3d::Zero(), body.state.frame);
  EXPECT_FALSE(sleeps(*body.model, body.scene, body.state));
  body.state = asleep;
  body.model->frame->apply(Eigen::Vector3d::Zero(), Eigen::Vector3d(0, 1, 0), body.state.frame);
  EXPECT_FALSE(sleeps(*body.model, body.scene, body.state));
  body.state = asleep;
  EXPECT_TRUE(sleeps(*body.model, body.scene, body.state));
}

/// Bodies that are thrown one by one, so that each comes to rest at another time.
std::uint64_t hash_of_crowd(const Hanging& kind, int count, int threads, std::int64_t& slept) {
  const WorldBodyStart start{{kind.model.get(), &kind.scene, nullptr}, make_state(*kind.model)};
  World world(std::vector<WorldBodyStart>(static_cast<std::size_t>(count), start), {1, 0, 0});
  slept = 0;
  for (int n = 0; n < 600; ++n) {
    if (n % 40 == 0) {
      State& thrown = world.state(n / 40 * 5 % count);
      thrown.v[0] += 0.1;
      thrown.begins_anew = true;
    }
    slept += world.step(threads).asleep;
  }
  FnvHash hash;
  for (int i = 0; i < count; ++i) add_to_hash(*kind.model, world.state(i), hash);
  return hash.value();
}

// In lanes, with a last group that is large enough for them, too small, and of none.
TEST(Sleep, NoBodyDependsOnWhoIsAwake) {
  const Hanging kind({.examples = 3});
  for (const int count : {21, 26}) {
    std::int64_t slept = 0, slept_by_two = 0;
    const std::uint64_t hash = hash_of_crowd(kind, count, 1, slept);
    EXPECT_EQ(hash, hash_of_crowd(kind, count, 2, slept_by_two)) << count;
    EXPECT_EQ(slept, slept_by_two);
    EXPECT_GT(slept, 50 * count);
    EXPECT_LT(slept, 550 * count);
  }
}

// Those that sleep are as good as not there.
TEST(Sleep, LanesOfSleepersChangeNothing) {
  Hanging kind;
  ASSERT_TRUE(kind.rests_within(2000));
  std::vector<State> states(8, kind.state), few;
  for (const std::size_t i : {1U, 2U, 4U, 5U, 6U}) {
    wake(states[i]);
    states[i].v[0] += 0.01 * static_cast<double>(i);
    few.push_back(states[i]);
  }
  LaneWorkspace workspace(*kind.model, kind.scene);
  std::vector<StepReport> reports(8);
  const auto step_all = [&](std::vector<State>& all) {
    std::vector<LaneBody> bodies;
    for (State& state : all) bodies.push_back({&kind.scene, &state});
    const test::AllocationCounter allocations;
    step_in_lanes(*kind.model, bodies, workspace, std::span(reports).first(all.size()));
    EXPECT_EQ(allocations.count(), 0);
  };
  for (int n = 0; n < 20; ++n) {
    step_all(few);
    step_all(states);
    EXPECT_EQ(reports[0].status, kStepAsleep);
    EXPECT_EQ(reports[1].status, 0U);
  }
  EXPECT_EQ(states[0].q, kind.state.q);
  EXPECT_EQ(states[7].step, kind.state.step + 20);
  std::size_t k = 0;
  for (const std::size_t i : {1U, 2U, 4U, 5U, 6U}) EXPECT_EQ(states[i].q, few[k++].q) << i;
}

TEST(Sleep, AllocatesNothing) {
  Hanging body = lying();
  for (int n = 0; n < 3; ++n) body.step();
  const test::AllocationCounter allocations;
  EXPECT_TRUE(body.rests_within(3000));
  for (int n = 0; n < 10; ++n) body.step();
  wake(body.state);
  body.step();
  EXPECT_EQ(allocations.count(), 0);
}

}  // namespace
}  // namespace exmat::runtime
