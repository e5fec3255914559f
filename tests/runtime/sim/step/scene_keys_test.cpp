#include "runtime/sim/step/scene_keys.h"

#include <gtest/gtest.h>

#include "tests/support/allocation_counter.h"
#include "tests/support/scenes.h"

namespace exmat::runtime {
namespace {

using test::Bar;

KeyedSetting numbers(const std::vector<double>& times, const std::vector<double>& values, Interpolation interpolation) {
  return {times, Eigen::Map<const Eigen::VectorXd>(values.data(), std::ssize(values)), interpolation};
}

KeyedSetting vectors(const std::vector<double>& times, const std::vector<Eigen::Vector3d>& values,
                     Interpolation interpolation) {
  RowMatrix rows(std::ssize(values), 3);
  for (std::size_t i = 0; i < values.size(); ++i) rows.row(static_cast<Eigen::Index>(i)) = values[i].transpose();
  return {times, rows, interpolation};
}

double at(const KeyedSetting& setting, double time) {
  Eigen::VectorXd value(1);
  setting.sample(time, value);
  return value[0];
}

TEST(KeyedSetting, IsHeldOrOnTheLineFromKeyToKey) {
  const KeyedSetting line = numbers({-1, 1, 3}, {2, 6, 5}, Interpolation::kLinear);
  const KeyedSetting steps = numbers({-1, 1, 3}, {2, 6, 5}, Interpolation::kStep);
  const double times[] = {-5, -1, 0, 1, 2, 3, 9}, on_line[] = {2, 2, 4, 6, 5.5, 5, 5}, held[] = {2, 2, 2, 6, 6, 5, 5};
  for (std::size_t i = 0; i < std::size(times); ++i) {
    EXPECT_EQ(at(line, times[i]), on_line[i]) << times[i];
    EXPECT_EQ(at(steps, times[i]), held[i]) << times[i];
  }
  EXPECT_TRUE(steps.jumps(0, 1));
  EXPECT_FALSE(steps.jumps(1, 2.5));
  EXPECT_FALSE(steps.jumps(-5, -1)) << "it had that value before";
  EXPECT_FALSE(line.jumps(-5, 9));
  EXPECT_FALSE(numbers({0, 1}, {3, 3}, Interpolation::kStep).jumps(0, 1)) << "the same value again";
}

/// Steps with keys, `count` of them.
void advance(const Model& model, const SceneKeys& keys, int count, StepScene& scene, State& state,
             Workspace& workspace) {
  for (int i = 0; i < count; ++i) {
    keys.apply(model, state.step, scene);
    step(model, scene, state, workspace);
  }
}

// Gravity that is switched, and one that grows: integrals of it, which the steps take by their middles. A line's
// second integral that way is off by slope dt^3 / 12 in each step.
TEST(SceneKeys, AFreeBodyFallsUnderThemAsItShould) {
  const auto model = prepared(test::make_bar({.cells = {3, 1, 1}, .free = true, .linear_modes = 3}));
  const double dt = 0.01, mass = model->frame->residual_of({1, 0, 0}) > 0
                                     ? 1 / std::pow(model->frame->residual_of({1, 0, 0}), 2)
                                     : 0;
  const Eigen::Vector3d down(0, 0, -9.81), aside(3, 0, 0);
  for (const Integrator integrator : kIntegrators) {
    StepScene scene = free_scene(*model, integrator, dt);
    Workspace workspace(*model, scene);
    SceneKeys keys;
    keys.gravity = vectors({0.1, 0.25}, {down, aside}, Interpolation::kStep);
    State state = make_state(*model);
    advance(*model, keys, 100, scene, state, workspace);
    // 0.25 s down, then 0.75 s aside.
    EXPECT_LE((free_state(state).linear_momentum - mass * (0.25 * down + 0.75 * aside)).norm(), 1e-12 * mass);
    const Eigen::Vector3d fallen = (0.25 * 0.25 / 2 + 0.25 * 0.75) * down + Eigen::Vector3d(0.75 * 0.75 / 2 * aside);
    EXPECT_LE((free_state(state).position - fallen).norm(), 1e-11);

    keys.gravity = vectors({0, 2}, {Eigen::Vector3d::Zero(), down}, Interpolation::kLinear);
    state = make_state(*model);
    advance(*model, keys, 100, scene, state, workspace);
    const Eigen::Vector3d slope = down / 2;
    EXPECT_LE((free_state(state).linear_momentum - mass * slope / 2).norm(), 1e-12 * mass);
    EXPECT_LE((free_state(state).position - slope / 6 - 100 * dt * dt * dt / 12 * slope).norm(), 1e-11);
  }
}

// Gravity for a while is a force for a while: what scripted forces do, with their exact impulses.
TEST(SceneKeys, GravityThatIsSwitchedIsAScriptedForceToTheLastBit) {
  const auto model = prepared(test::make_bar({.cells = {4, 1, 1}, .linear_modes = 4}));
  const Eigen::Vector3d down(0, 0, -9.81);
  for (const Integrator integrator : kIntegrators) {
    StepScene forced = free_scene(*model, integrator, 0.01), keyed = forced;
    forced.forces.push_back({gravity_force(*model, down), 0.05, 0.2});
    SceneKeys keys;
    keys.gravity =
        vectors({0, 0.05, 0.2}, {Eigen::Vector3d::Zero(), down, Eigen::Vector3d::Zero()}, Interpolation::kStep);
    State a = make_state(*model), b = a;
    Workspace workspace(*model, forced);
    for (int i = 0; i < 40; ++i) {
      step(*model, forced, a, workspace);
      advance(*model, keys, 1, keyed, b, workspace);
      ASSERT_EQ(a.q, b.q) << i;
      ASSERT_EQ(a.v, b.v) << i;
    }
    EXPECT_GT(a.q.norm(), 0);
  }
}

/// A bar with examples, its force held at the rest pose: -kappa P q.
struct HeldBar {
  Bar bar = full_bar({.cells = {4, 1, 1}, .linear_modes = 4, .eigenfunctions = 4, .examples = 3});
  std::unique_ptr<const Model> model = prepared(bar, {.target_table = true});

  StepScene scene(Integrator integrator, double dt) const {
    StepScene scene = free_scene(*model, integrator, dt);
    scene.examples.push_back({.stiffness = 300, .damping = 0});
    return scene;
  }
};

// As a host's setters between steps.
TEST(SceneKeys, AreTheSettingsOfTheStepsToTheLastBit) {
  const HeldBar held;
  const Model& model = *held.model;
  SceneKeys keys;
  keys.gravity = vectors({0, 0.4}, {{0, 0, -9.81}, {2, 0, 0}}, Interpolation::kLinear);
  ExampleKeys& examples = keys.examples.emplace_back();
  examples.stiffness = numbers({0.1, 0.3}, {0, 800}, Interpolation::kLinear);
  examples.damping = numbers({0, 0.2}, {1, 3}, Interpolation::kStep);
  examples.bias = numbers({0, 0.4}, {1, 0.25}, Interpolation::kLinear);
  for (const Integrator integrator : kIntegrators) {
    const double dt = 0.01;
    StepScene keyed = held.scene(integrator, dt), set = keyed;
    State a = make_state(model), b = a;
    Workspace workspace(model, keyed);
    for (int i = 0; i < 50; ++i) {
      advance(model, keys, 1, keyed, a, workspace);
      const double end = static_cast<double>(i + 1) * dt, middle = static_cast<double>(i) * dt + 0.5 * dt;
      const double share = std::min(1.0, end / 0.4), ramp = std::clamp((end - 0.1) / (0.3 - 0.1), 0.0, 1.0);
      set.gravity = Eigen::Vector3d(0, 0, -9.81) + share * (Eigen::Vector3d(2, 0, 0) - Eigen::Vector3d(0, 0, -9.81));
      if (end >= 0.4) set.gravity = {2, 0, 0};
      set.gravity_force = gravity_force(model, set.gravity);
      set.examples[0].stiffness = end >= 0.3 ? 800 : ramp * 800;
      set.examples[0].damping = middle < 0.2 ? 1 : 3;
      set.examples[0].bias = end >= 0.4 ? 0.25 : 1 + share * (0.25 - 1);
      set.begins_anew = i == 20;  // the damping jumps
      step(model, set, b, workspace);
      ASSERT_EQ(a.q, b.q) << i;
      ASSERT_EQ(a.v, b.v) << i;
    }
  }
}

// A growing kappa adds to the energy the integral of kappa' q^T P q / 2: exact in the limit, of second order.
TEST(SceneKeys, TheEnergyOfARampIsItsWork) {
  const HeldBar held;
  const Model& model = *held.model;
  const RowMatrix P = model.examples[0].filter;
  SceneKeys keys;
  keys.examples.emplace_back().stiffness = numbers({0, 0.2}, {100, 2000}, Interpolation::kLinear);
  const auto missed = [&](int steps) {
    const double dt = 0.2 / steps;
    StepScene scene = held.scene(Integrator::kNewmark, dt);
    scene.newton.tolerance = 1e-12;
    scene.examples[0].given_weights = Eigen::Vector3d::UnitX();
    Workspace workspace(model, scene);
    State state = make_state(model, 1e-3 * Eigen::VectorXd::Ones(model.modes()), Eigen::VectorXd::Zero(model.modes()));
    const auto kappa = [&] { return 100 + 1900 * state.time / 0.2; };
    const auto square = [&] { return state.q.dot(P * state.q); };
    const auto energy = [&] { return energies(model, scene, state).total() + 0.5 * kappa() * square(); };
    const double start = energy();
    double work = 0;
    for (int i = 0; i < steps; ++i) {
      work += 0.25 * dt * (1900 / 0.2) * square();
      advance(model, keys, 1, scene, state, workspace);
      work += 0.25 * dt * (1900 / 0.2) * square();
    }
    EXPECT_GT(work, 0.05 * start);
    return std::abs(energy() - start - work) / start;
  };
  const double coarse = missed(2000), fine = missed(4000);
  EXPECT_LE(coarse, 1e-3);
  EXPECT_LE(fine, coarse / 3.5) << "of second order";
}

TEST(SceneKeys, AllocateNothing) {
  if (!test::AllocationCounter::works()) GTEST_SKIP() << "a sanitizer owns malloc";
  const HeldBar held;
  SceneKeys keys;
  keys.gravity = vectors({0, 0.4}, {{0, 0, -9.81}, {2, 0, 0}}, Interpolation::kLinear);
  ExampleKeys& examples = keys.examples.emplace_back();
  examples.stiffness = numbers({0.1, 0.3}, {0, 800}, Interpolation::kLinear);
  examples.weights = vectors({0, 0.1}, {{1, 0, 0}, {0, 0.5, 0.5}}, Interpolation::kStep);
  StepScene scene = held.scene(Integrator::kBdf2, 0.01);
  scene.examples[0].given_weights = Eigen::Vector3d::UnitX();
  State state = make_state(*held.model);
  Workspace workspace(*held.model, scene);
  const test::AllocationCounter counter;
  advance(*held.model, keys, 40, scene, state, workspace);
  EXPECT_EQ(counter.count(), 0U);
  EXPECT_EQ(state.examples[0].weights, Eigen::Vector3d(0, 0.5, 0.5));
}

}  // namespace
}  // namespace exmat::runtime
