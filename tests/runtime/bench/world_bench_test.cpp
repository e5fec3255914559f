#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "common/bundle/bundle.h"
#include "common/config/config.h"
#include "common/core/error.h"
#include "runtime/bench/bench.h"
#include "runtime/scene/scene_run.h"
#include "tests/support/synthetic_model.h"
#include "tests/support/temporary_folder.h"

namespace exmat::runtime {
namespace world_bench_test {

constexpr double kRounding = 1e-12;

class WorldBenchTest : public ::testing::Test {
 protected:
  WorldBenchTest() {
    test::Bar bar =
        test::make_bar({.cells = {2, 2, 2}, .lengths = {0.2, 0.2, 0.2}, .youngs_modulus = 1e6, .free = true});
    bar.model.contact = test::surface_contact(bar.model);
    write_bundle(bar.model, folder_.path("block.h5"));
  }
  /// Two blocks on each other, the lower one on a floor.
  WorldConfig world(const std::string& more = "") const {
    return load_world(folder_.write("world.json", R"({"time_step": 0.002, "steps": 40, "gravity": [0, 0, -9.81],
      "contact": {"stiffness": 1e7, "damping": 2e4}, "obstacles": [{"plane": {"normal": [0, 0, 1]}, "stiffness": 1e7}],
      "bodies": [{"name": "block", "bundle": "block.h5",
                  "grid": {"counts": [1, 1, 2], "spacing": [0, 0, 0.2005]})" +
                                                      more + "}]}"));
  }

  test::TemporaryFolder folder_;
};

TEST_F(WorldBenchTest, PrintsMembersThatFitEachOther) {
  const WorldConfig config = world();
  const LoadedWorld loaded = load_world_run(config);
  const nlohmann::json json = to_json(bench(loaded, config, {.steps = 30, .seconds = 0.05}));
  EXPECT_EQ(json["steps"], 30);
  EXPECT_EQ(json["instances"], 2);
  EXPECT_EQ(json["bodies"][0]["name"], "block");
  EXPECT_EQ(json["bodies"][0]["instances"], 2);
  EXPECT_EQ(json["largest_island"], 2);
  EXPECT_EQ(json["touching_pairs_most"], 1);
  EXPECT_GT(json["touching_pairs_mean"].get<double>(), 0);
  EXPECT_LE(json["islands_mean"].get<double>(), 1);
  EXPECT_EQ(json["unconverged_islands"], 0);
  EXPECT_GE(json["newton_iterations_mean"].get<double>(), 1);
  EXPECT_LE(json["step"]["median_us"], json["step"]["p95_us"]);
  const double mean = json["step"]["mean_us"];
  double sum = 0, shares = 0;
  for (const char* stage : {"broad_phase", "candidates", "single_bodies", "islands", "other"}) {
    sum += json["stages"][stage]["mean_us"].get<double>();
    shares += json["stages"][stage]["share"].get<double>();
  }
  EXPECT_GT(sum, 0) << "measured in other steps than the whole";
  EXPECT_NEAR(shares, 1, kRounding);
  EXPECT_EQ(json["stages"].size(), 5U);
  const double factor = json["real_time_factor"];
  EXPECT_NEAR(factor, 0.002 / (2e-6 * mean), kRounding * factor);
  EXPECT_NEAR(json["steps_per_second"].get<double>(), 1e6 / mean, kRounding * 1e6 / mean);
}

TEST_F(WorldBenchTest, ARoundIsARunOfTheScene) {
  WorldConfig config = world();
  const LoadedWorld loaded = load_world_run(config);
  const BenchResult result = bench(loaded, config, {.steps = 25, .seconds = 0.02});
  config.steps = 25;
  EXPECT_EQ(result.state_hash, run(loaded, config).state_hash);
  EXPECT_EQ(result.threads, run(loaded, config).threads);
}

TEST_F(WorldBenchTest, ANonFiniteStepIsAFailure) {
  WorldConfig config = world(R"(, "forces": [{"vertices": {"ids": [0]}, "force": [1, 0, 0]}])");
  for (BodiesConfig& bodies : config.bodies)
    for (VertexForceConfig& force : bodies.scene.forces) force.force[0] = 1e300;
  const LoadedWorld loaded = load_world_run(config);
  EXPECT_THROW(bench(loaded, config, {.seconds = 0.01}), WorkError);
}

}  // namespace world_bench_test
}  // namespace exmat::runtime
