#include <fstream>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "common/bundle/bundle.h"
#include "common/config/config.h"
#include "common/core/error.h"
#include "common/hdf5/hdf5_file.h"
#include "runtime/scene/scene_run.h"
#include "runtime/scene/state_file.h"
#include "tests/support/synthetic_model.h"
#include "tests/support/temporary_folder.h"

namespace exmat::runtime {
namespace {

using ::testing::HasSubstr;

/// Free blocks and a clamped one, as bundles.
class WorldRunTest : public ::testing::Test {
 protected:
  void SetUp() override {
    test::Bar free =
        test::make_bar({.cells = {4, 2, 2}, .lengths = {0.4, 0.2, 0.2}, .youngs_modulus = 1e6, .free = true});
    free.model.contact = test::surface_contact(free.model);
    write_bundle(free.model, folder_.path() / "free.h5");
    test::Bar clamped = test::make_bar({.youngs_modulus = 1e6});
    clamped.model.contact = test::surface_contact(clamped.model);
    write_bundle(clamped.model, folder_.path() / "clamped.h5");
  }
  WorldConfig world(const std::string& bodies, const std::string& more = "") const {
    const auto file = folder_.path() / "world.json";
    std::ofstream(file) << R"({"time_step": 0.002, "steps": 60, "gravity": [0, 0, -9.81],
      "contact": {"stiffness": 1e7, "damping": 2e4, "friction": 0.4}, "bodies": [)"
                        << bodies << "]" << more << "}";
    return load_world(file);
  }

  test::TemporaryFolder folder_;
};

constexpr const char* kTwoKinds = R"({"name": "shelf", "bundle": "clamped.h5"},
  {"name": "block", "bundle": "free.h5", "body": {"position": [0.3, 0.013, 0.26]},
   "grid": {"counts": [1, 1, 2], "spacing": [0, 0, 0.22]}})";

TEST_F(WorldRunTest, WritesAGroupForEachBodyAndRunsTheSameEachTime) {
  WorldConfig config = world(kTwoKinds, R"(, "output": {"trajectory": "w.h5", "every": 20})");
  const LoadedWorld loaded = load_world_run(config);
  const RunSummary summary = run(loaded, config);
  EXPECT_EQ(summary.bodies, 3);
  EXPECT_EQ(summary.steps, 60);
  EXPECT_EQ(summary.unconverged_steps, 0);
  EXPECT_GT(summary.most_pairs, 0);
  EXPECT_GT(summary.largest_island, 1);
  EXPECT_LE(summary.end.total(), summary.start.total());
  const Hdf5File file = Hdf5File::open(folder_.path() / "w.h5");
  for (const char* name : {"shelf", "block_0", "block_1"}) {
    const std::string group = std::string("/bodies/") + name;
    EXPECT_EQ(file.open_dataset(group + "/vertices").sizes()[0], 4) << name;
    EXPECT_EQ(file.open_dataset(group + "/energy/kinetic").sizes()[0], 4) << name;
  }
  EXPECT_FALSE(file.has_dataset("/vertices"));
  EXPECT_TRUE(std::filesystem::exists(folder_.path() / "w.xdmf"));
  // The upper block starts above the lower one.
  std::vector<double> position(3 * 4);
  const Hdf5Dataset places = file.open_dataset("/bodies/block_1/body/position");
  places.read(position.data(), ElementType::kFloat64);
  EXPECT_NEAR(position[2], 0.26 + 0.22, 1e-12);
  config.trajectory.reset();
  EXPECT_EQ(run(loaded, config).state_hash, summary.state_hash);
}

TEST_F(WorldRunTest, WhatOverlapsAtTheStartIsFoundHoweverFastItIsLetOut) {
  for (const double release : {0.1, 1.0, 1e30}) {
    WorldConfig config =
        world(R"({"name": "block", "bundle": "free.h5", "grid": {"counts": [1, 1, 2], "spacing": [0, 0, 0.15]}})");
    config.steps = 1;
    config.contact.release = release;
    const auto overlap = run(load_world_run(config), config).overlap;
    ASSERT_TRUE(overlap) << release;
    EXPECT_FALSE(overlap->is_obstacle);
    EXPECT_NEAR(overlap->depth, 0.05, 1e-6) << release;
  }
}

TEST_F(WorldRunTest, WhatBeginsInAnObstacleIsFoundHoweverFastThatGoes) {
  for (const char* const motion : {"", R"(, "motion": [{"time": 0}, {"time": 1, "position": [1e5, 0, 0]}])"})
    for (const double release : {0.1, 1.0, 1e30}) {
      WorldConfig config = world(R"({"name": "block", "bundle": "free.h5"})",
                                 R"(, "obstacles": [{"plane": {"point": [0, 0, -1], "normal": [0, 0, 1]}},
                                                    {"plane": {"point": [0, 0, 0.05], "normal": [0, 0, 1]})" +
                                     std::string(motion) + "}]");
      config.steps = 1;
      config.contact.release = release;
      for (ObstacleConfig& obstacle : config.bodies.front().scene.obstacles) obstacle.stiffness = 1;
      const auto overlap = run(load_world_run(config), config).overlap;
      ASSERT_TRUE(overlap) << release << motion;
      EXPECT_TRUE(overlap->is_obstacle);
      EXPECT_EQ(overlap->other, 1);
      EXPECT_NEAR(overlap->depth, 0.05, 1e-6) << release << motion;
    }
}

TEST_F(WorldRunTest, ABodyWithFixedVerticesHasOnePlace) {
  const WorldConfig config =
      world(R"({"name": "shelf", "bundle": "clamped.h5", "grid": {"counts": [2, 1, 1], "spacing": [2, 0, 0]}})");
  try {
    load_world_run(config);
    FAIL();
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr("/bodies/0"));
    EXPECT_THAT(error.what(), HasSubstr("one place"));
  }
}

// The bits of all bodies and of what pairs remember: of 60 steps in one run, and in two with a file between them,
// before and after the blocks have met.
TEST_F(WorldRunTest, ARunThatIsTakenUpIsTheWholeRunToTheLastBit) {
  const std::string floor =
      R"(, "obstacles": [{"plane": {"point": [0, 0, -0.4], "normal": [0, 0, 1]}, "friction": 0.3}])";
  WorldConfig config = world(kTwoKinds, floor);
  const LoadedWorld loaded = load_world_run(config);
  const std::uint64_t whole = run(loaded, config).state_hash;
  const auto state = folder_.path() / "state.json";
  std::size_t pairs = 0;
  for (const int first : {1, 20, 45}) {
    config.steps = first;
    run(loaded, config, {.dump_state = state});
    pairs = std::max(pairs, nlohmann::json::parse(test::read_file(state))["pairs"].size());
    config.steps = 60 - first;
    EXPECT_EQ(run(loaded, config, {.from_state = state}).state_hash, whole) << first;
  }
  EXPECT_GE(pairs, 1U) << "some touch where a run is taken up";
  const BodiesMemory memory = read_state(state, loaded, config);
  write_state(memory, loaded, config, folder_.path() / "again.json");
  EXPECT_EQ(test::read_file(folder_.path() / "again.json"), test::read_file(state));
}

TEST_F(WorldRunTest, AStateFileThatDoesNotFitIsRefusedWithThePlace) {
  WorldConfig config = world(kTwoKinds);
  config.steps = 45;
  const LoadedWorld loaded = load_world_run(config);
  const auto state = folder_.path() / "state.json";
  run(loaded, config, {.dump_state = state});
  const auto good = nlohmann::json::parse(test::read_file(state));
  const auto refusal = [&](const char* pointer, const nlohmann::json& value) -> std::string {
    nlohmann::json bad = good;
    bad[nlohmann::json::json_pointer(pointer)] = value;
    test::write_file(state, bad.dump());
    try {
      read_state(state, loaded, config);
    } catch (const InputError& error) {
      return error.what();
    }
    return "none";
  };
  EXPECT_THAT(refusal("/format_version", 1),
              HasSubstr("state.json: /format_version: expected a state of a scene that lists"));
  EXPECT_THAT(refusal("/time_step", 0.1), HasSubstr("state.json: /time_step: expected 0.002"));
  EXPECT_THAT(refusal("/bodies/3", good["bodies"][0]), HasSubstr("state.json: /bodies: expected 3"));
  EXPECT_THAT(refusal("/bodies/1/name", "shelf"), HasSubstr("state.json: /bodies/1/name: expected \"block_0\""));
  EXPECT_THAT(refusal("/bodies/1/bundle_input_sha256", "b"), HasSubstr("/bodies/1/bundle_input_sha256: expected"));
  EXPECT_THAT(refusal("/bodies/1/step", 7), HasSubstr("/bodies/1/step: expected 45"));
  EXPECT_THAT(refusal("/bodies/1/reduced", nlohmann::json::array({1.0})), HasSubstr("/bodies/1/reduced: expected"));
  ASSERT_FALSE(good["pairs"].empty());
  EXPECT_THAT(refusal("/pairs/0/second", 9), HasSubstr("/pairs/0/second: expected a body below 3"));
  EXPECT_THAT(refusal("/pairs/0/first", 2), HasSubstr("/pairs/0/second: expected at least 2"));
  const auto vertex =
      nlohmann::json{{"vertex", 100000}, {"gap", 0}, {"normal_force", 0}, {"stretch", {0, 0, 0}}, {"side", {0, 0, 1}}};
  EXPECT_THAT(refusal("/pairs/0/first_vertices", nlohmann::json::array({vertex})),
              HasSubstr("/first_vertices/0/vertex: expected vertices"));
  EXPECT_THAT(refusal("/pairs/0/deepest", 1), HasSubstr("unknown member"));
}

TEST_F(WorldRunTest, StagesOfARunAddUpToItsSteps) {
  WorldConfig config = world(kTwoKinds);
  const RunSummary summary = run(load_world_run(config), config, {.profiled = true});
  double sum = 0;
  for (const Samples& stage : summary.stage_seconds->of_world) sum += stage.mean();
  EXPECT_NEAR(sum, summary.step_seconds.mean(), 1e-12);
  EXPECT_GT(summary.stage_seconds->of_world[static_cast<std::size_t>(WorldStage::kIslands)].mean(), 0);
}

}  // namespace
}  // namespace exmat::runtime
