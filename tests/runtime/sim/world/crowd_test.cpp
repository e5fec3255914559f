#include "runtime/sim/world/crowd.h"

#include <gtest/gtest.h>
#include <memory>
#include <optional>
#include <vector>

#include "runtime/sim/world/world.h"
#include "tests/support/synthetic_model.h"

namespace exmat::runtime {
namespace {

Model model_of(int modes) {
  const exmat::test::Bar bar = exmat::test::make_bar({.cells = {3, 1, 1}, .linear_modes = modes});
  return std::move(*build_model(bar.model, {}).model);
}

StepScene scene_of(const Model& model) {
  StepScene scene;
  scene.time_step = 1e-3;
  scene.gravity = {0, 0, -9.81};
  scene.gravity_force = model.gravity_load.transpose() * scene.gravity;
  return scene;
}

/// Bodies of one model that touch nothing, in a world with others.
struct Hosted {
  Hosted(const Model& its_model, int count) : model(its_model), scene(scene_of(model)) {
    for (int i = 0; i < count; ++i) states.push_back(std::make_unique<State>(make_state(model)));
  }

  void join(World& world) {
    for (const auto& state : states) world.add({&model, &scene, nullptr}, *state);
  }
  /// Expects of each body a run of one that is by itself [r]; sums are taken in another order: 1e-13 of a step.
  void expect_alone(int steps) const {
    State alone = make_state(model);
    Workspace workspace(model, scene);
    for (int i = 0; i < steps; ++i) step(model, scene, alone, workspace);
    for (const auto& state : states) {
      EXPECT_EQ(state->step, steps);
      EXPECT_LE((state->q - alone.q).norm(), 1e-11 * alone.q.norm());
    }
  }

  const Model& model;
  StepScene scene;
  std::vector<std::unique_ptr<State>> states;
};

// Threads that begin after all bodies of a model have gone have scratch for those that are left.
TEST(Crowd, NewThreadsServeTheModelsThatAreLeft) {
  const Model small = model_of(3), large = model_of(8);
  Hosted gone(small, 1), left(large, 20);
  World world(ContactLaw{1e6, 0, 0});
  gone.join(world);
  left.join(world);
  world.remove(0);
  for (int i = 0; i < 20; ++i) world.step(4);
  left.expect_alone(20);
}

// A host may free a model with its last body, and make another one in its place.
TEST(Crowd, AModelWhereAnotherOneWasHasScratchOfItsOwn) {
  std::optional<Model> model(model_of(3));
  World world(ContactLaw{1e6, 0, 0});
  {
    Hosted gone(*model, 9);
    gone.join(world);
    world.step(2);
    while (world.count() > 0) world.remove(0);
  }
  model.emplace(model_of(8));
  Hosted next(*model, 9);
  next.join(world);
  for (int i = 0; i < 20; ++i) world.step(2);
  next.expect_alone(20);
}

}  // namespace
}  // namespace exmat::runtime
