#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "common/bundle/bundle.h"
#include "common/config/config.h"
#include "common/core/error.h"
#include "runtime/bench/bench.h"
#include "runtime/scene/scene_run.h"
#include "tests/support/scene_run.h"
#include "tests/support/scenes.h"
#include "tests/support/temporary_folder.h"

namespace exmat::runtime {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;

constexpr const char* kKeyed = R"("gravity": {"keys": [{"time": 0, "value": [0, -9.81, 0]},
    {"time": 0.15, "value": [0, 4, 0]}], "interpolation": "step"},
  "examples": {"stiffness": {"keys": [{"time": 0.05, "value": 0}, {"time": 0.2, "value": 900}]}, "damping": 2,
               "bias": {"keys": [{"time": 0.1, "value": 0.8}, {"time": 0.3, "value": 0.2}]}, "target": "solve"})";

class KeyedRun : public ::testing::Test {
 protected:
  KeyedRun() {
    test::Bar bar =
        full_bar({.cells = {3, 1, 1}, .carried = true, .linear_modes = 4, .eigenfunctions = 3, .examples = 3});
    bar.model.cubature->internal_force = ForceMethod::kCubature;
    bar.model.contact = test::surface_contact(bar.model);
    bar.model.input_sha256 = std::string(64, 'a');
    write_bundle(bar.model, folder_.path("bar.h5"));
  }
  std::filesystem::path file(const std::string& members) const {
    return folder_.write("scene.json", R"({"time_step": 0.01, )" + members + "}");
  }
  SceneConfig scene(const std::string& members, int steps = 40) const {
    return load_scene(file(R"("bundle": "bar.h5", "steps": )" + std::to_string(steps) + ", " + members));
  }

  test::TemporaryFolder folder_;
};

TEST_F(KeyedRun, IsTheRunOfAHostThatSetsThem) {
  const SceneConfig config = scene(std::string(kKeyed) + R"(, "instances": 3)");
  const test::LoadedRun whole(config);
  const LoadedScene& loaded = whole.kind();
  const std::uint64_t keyed = whole.run().state_hash;
  StepScene set = loaded.scene;
  State state = loaded.start;
  Workspace workspace(*loaded.model, set);
  for (int i = 0; i < 40; ++i) {
    const double end = 0.01 * (i + 1);
    set.gravity = Eigen::Vector3d(0, i < 15 ? -9.81 : 4, 0);
    set.gravity_force = gravity_force(*loaded.model, set.gravity);
    set.begins_anew = i == 15;
    const double ramp = std::clamp((end - 0.05) / (0.2 - 0.05), 0.0, 1.0);
    set.examples[0].stiffness = ramp * 900;
    const double share = std::clamp((end - 0.1) / (0.3 - 0.1), 0.0, 1.0);
    set.examples[0].bias = share < 1 ? 0.8 + share * (0.2 - 0.8) : 0.2;
    step(*loaded.model, set, state, workspace);
  }
  FnvHash hash;
  for (int body = 0; body < 3; ++body) add_to_hash(*loaded.model, state, hash);
  EXPECT_EQ(keyed, hash.value());
  EXPECT_GT(state.q.norm(), 0);
}

TEST_F(KeyedRun, IsTakenUpToTheLastBitAndMeasured) {
  const SceneConfig whole = scene(kKeyed);
  const std::uint64_t hash = test::run(whole).state_hash;
  for (const int first : {14, 15, 16}) {  // gravity jumps between
    const SceneConfig before = scene(kKeyed, first), after = scene(kKeyed, 40 - first);
    test::run(before, {.dump_state = folder_.path("state.json")});
    EXPECT_EQ(test::run(after, {.from_state = folder_.path("state.json")}).state_hash, hash) << first;
  }
  const test::LoadedRun loaded(whole);
  EXPECT_EQ(bench(loaded.world, loaded.config, {.steps = 40, .seconds = 0.02}).state_hash, hash);
}

TEST_F(KeyedRun, ThePlanNamesThem) {
  const SceneConfig config = scene(kKeyed);
  const std::vector<std::string> plan = describe_plan(load_run(config), config);
  EXPECT_THAT(plan, Contains("gravity: keyed, 2 keys from 0 to 0.15 s, step"));
  EXPECT_THAT(plan, Contains("examples: stiffness: keyed, 2 keys from 0.05 to 0.2 s, linear"));
  EXPECT_THAT(plan, Contains("examples: bias: keyed, 2 keys from 0.1 to 0.3 s, linear"));
}

// Bodies far from each other, one of which has a gravity of its own: each as it is alone.
TEST_F(KeyedRun, OfSeveralBodiesIsThatOfEach) {
  const std::string examples = std::string(kKeyed).substr(std::string(kKeyed).find("\"examples\""));
  const std::string own =
      R"("gravity": {"keys": [{"time": 0, "value": [1, 0, 0]}, {"time": 0.3, "value": [0, 2, 0]}]})";
  const WorldConfig config = load_world(file(R"("steps": 40, "gravity": [0, -1, 0], "bodies": [
    {"name": "plain", "bundle": "bar.h5"},
    {"name": "keyed", "bundle": "bar.h5", "body": {"motion": [{"time": 0, "position": [90, 0, 0]}]}, )" +
                                             own + ", " + examples + "}]"));
  const LoadedWorld loaded = load_world_run(config);
  Bodies bodies(loaded, config);
  for (int i = 0; i < 40; ++i) bodies.step();
  const SceneConfig plain = scene(R"("gravity": [0, -1, 0])");
  const SceneConfig keyed =
      scene(R"("body": {"motion": [{"time": 0, "position": [90, 0, 0]}]}, )" + own + ", " + examples);
  for (const auto& [number, alone] : {std::pair(0, plain), std::pair(1, keyed)}) {
    const test::LoadedRun single(alone);
    Bodies body = single.bodies();
    for (int i = 0; i < 40; ++i) body.step();
    EXPECT_EQ(bodies.world().state(number).q, body.world().state(0).q) << number;
    EXPECT_EQ(bodies.world().state(number).v, body.world().state(0).v) << number;
    EXPECT_GT(body.world().state(0).q.norm(), 0);
  }
}

TEST_F(KeyedRun, WeightsAreThoseThatAreGiven) {
  const SceneConfig config = scene(R"("examples": {"stiffness": 300, "target": "solve", "weights":
    {"keys": [{"time": 0, "value": [1, 0, 0]}, {"time": 0.2, "value": [0, 0.25, 0.75]}]}})");
  const test::LoadedRun loaded(config);
  Bodies bodies = loaded.bodies();
  const State& state = bodies.world().state(0);
  EXPECT_EQ(state.examples[0].weights, Eigen::Vector3d(1, 0, 0));
  for (int i = 0; i < 10; ++i) bodies.step();
  EXPECT_LE((state.examples[0].weights - Eigen::Vector3d(0.5, 0.125, 0.375)).norm(), 1e-15);
  for (int i = 0; i < 30; ++i) bodies.step();
  EXPECT_EQ(state.examples[0].weights, Eigen::Vector3d(0, 0.25, 0.75));
  try {
    load_run(scene(R"("examples": {"stiffness": 300, "weights": [0.5, 0.5]})"));
    FAIL();
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr("scene.json: /examples/weights: expected 3 numbers"));
  }
}

}  // namespace
}  // namespace exmat::runtime
