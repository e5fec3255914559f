#include "runtime/bench/bench.h"

#include <fstream>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <omp.h>

#include "common/config/config.h"
#include "common/core/error.h"
#include "tests/support/scene_run.h"
#include "tests/support/scenes.h"
#include "tests/support/temporary_folder.h"

namespace exmat::runtime {
namespace {

using Json = nlohmann::json;

constexpr double kRounding = 1e-12;

class BenchTest : public ::testing::Test {
 protected:
  BenchTest() {
    test::Bar bar = full_bar({.cells = {3, 1, 1}, .linear_modes = 4, .eigenfunctions = 3, .examples = 3});
    bar.model.cubature->internal_force = ForceMethod::kCubature;
    write_bundle(bar.model, folder_.path("bar.h5"));
  }

  SceneConfig scene(const std::string& members) const {
    return load_scene(folder_.write("scene.json",
                                    "{\"bundle\": \"bar.h5\", \"time_step\": 0.01, \"steps\": 30, "
                                    "\"gravity\": [0, -9.81, 0]" +
                                        members + "}"));
  }

  BenchResult measured(const std::string& members, std::optional<std::int64_t> steps = 25) const {
    const SceneConfig config = scene(members);
    const test::LoadedRun loaded(config);
    return bench(loaded.world, loaded.config, {.steps = steps, .seconds = 0.02});
  }

  test::TemporaryFolder folder_;
};

const std::string kExamples = ", \"examples\": {\"stiffness\": 300, \"bias\": 0.5}";

TEST_F(BenchTest, JsonHasEveryMemberOfItsType) {
  const Json json = Json::parse(to_json(measured(kExamples)).dump());
  for (const char* name : {"r", "s", "steps", "instances", "rounds", "threads", "examples", "vertices", "tets"})
    EXPECT_TRUE(json.at(name).is_number_integer()) << name;
  for (const char* name :
       {"flops", "gflops", "dgemm_gflops", "limit_ratio", "newton_iterations_mean", "real_time_factor",
        "steps_per_second", "limit_us", "dgemm_median_gflops", "bytes", "factorisations_mean",
        "line_search_evaluations_mean", "projections_mean", "target_iterations_mean", "time_step"})
    EXPECT_TRUE(json.at(name).is_number_float()) << name;
  for (const char* name : {"instruction_set", "integrator", "internal_force", "target", "state_hash"})
    EXPECT_TRUE(json.at(name).is_string()) << name;
  for (const char* name : {"median_us", "p95_us", "mean_us"}) {
    EXPECT_GT(json.at("step").at(name).get<double>(), 0) << name;
    for (const std::string_view stage : kBenchStageNames)
      EXPECT_TRUE(json.at("stages").at(std::string(stage)).at(name).is_number_float()) << stage;
  }
  EXPECT_EQ(json.at("stages").size(), kBenchStageNames.size());
  EXPECT_EQ(json.at("r"), 6);
  EXPECT_EQ(json.at("s"), 18);
  EXPECT_EQ(json.at("steps"), 25);
  EXPECT_EQ(json.at("instances"), 1);
  EXPECT_EQ(json.at("examples"), 3);
  EXPECT_EQ(json.at("instruction_set"), kernels().name);
  EXPECT_EQ(json.at("state_hash").get<std::string>().size(), 16U);
}

TEST_F(BenchTest, NumbersAreConsistent) {
  const Json json = to_json(measured(kExamples));
  const double median = 1e-6 * json["step"]["median_us"].get<double>();
  double sum = 0, mean = 0;
  for (const auto& [name, stage] : json["stages"].items()) {
    EXPECT_LE(stage["median_us"], stage["p95_us"]) << name;
    EXPECT_EQ(stage["flops"].get<double>() > 0, name != "contact") << name;  // the scene has no obstacles
    sum += stage["flops"].get<double>();
    mean += stage["mean_us"].get<double>();
  }
  const double flops = json["flops"], rate = 1e9 * json["dgemm_gflops"].get<double>();
  EXPECT_NEAR(sum, flops, kRounding * flops);
  EXPECT_NEAR(json["gflops"].get<double>(), 1e-9 * flops / median, kRounding * json["gflops"].get<double>());
  EXPECT_NEAR(json["limit_ratio"].get<double>(), median / (flops / rate), kRounding * median * rate / flops);
  EXPECT_NEAR(json["limit_us"].get<double>(), 1e6 * flops / rate, kRounding * 1e6 * flops / rate);
  EXPECT_LE(json["dgemm_median_gflops"], json["dgemm_gflops"]);
  EXPECT_LE(json["step"]["median_us"], json["step"]["p95_us"]);
  EXPECT_GE(json["newton_iterations_mean"].get<double>(), 1);
  EXPECT_GE(json["rounds"].get<int>(), 1);
  const double factor = json["real_time_factor"];
  EXPECT_NEAR(factor, 0.01 * json["steps_per_second"].get<double>(), kRounding * factor);
  EXPECT_GT(mean, 0);
}

TEST_F(BenchTest, CountsTheFlopsOfTheInternalForce) {
  const SceneConfig config = scene(", \"internal_force\": \"polynomial\"");
  const test::LoadedRun loaded(config);
  const BenchResult result = bench(loaded.world, loaded.config, {.steps = 10, .seconds = 0.01});
  EXPECT_EQ(result.kinds.front().internal_force, "polynomial");
  const double evaluations = 1 + result.newton_iterations + result.line_search_evaluations;
  const double expected = evaluations * loaded.kind().model->internal_force.force_flops();
  EXPECT_GE(result.stages[2].flops, expected * (1 - kRounding));
  EXPECT_LE(result.stages[2].flops, 2 * expected);
  EXPECT_GE(result.bytes, evaluations * loaded.kind().model->internal_force.bytes());
}

TEST_F(BenchTest, StagesThatAreLeftOutCostNothing) {
  const BenchResult result = measured("");
  EXPECT_EQ(result.kinds.front().target, "none");
  for (const std::size_t stage : {0U, 1U}) {
    EXPECT_EQ(result.stages[stage].flops, 0);
    EXPECT_EQ(result.stages[stage].seconds.mean(), 0);
  }
  EXPECT_EQ(result.target_iterations, 0);
}

TEST_F(BenchTest, TheTargetIsThatOfTheScene) {
  EXPECT_EQ(measured(kExamples).kinds.front().target, "table");
  const BenchResult solved = measured(", \"examples\": {\"stiffness\": 300, \"bias\": 0.5, \"target\": \"solve\"}");
  EXPECT_EQ(solved.kinds.front().target, "solve");
  EXPECT_GT(solved.target_iterations, 0);
}

TEST_F(BenchTest, ARoundIsARunOfTheScene) {
  for (const char* members : {", \"instances\": 3", ""}) {
    SceneConfig config = scene(kExamples + members);
    const test::LoadedRun loaded(config);
    const BenchResult result = bench(loaded.world, loaded.config, {.steps = 17, .seconds = 0.02});
    config.steps = 17;
    const RunSummary summary = test::run(config);
    EXPECT_EQ(result.steps, 17);
    EXPECT_EQ(result.instances, config.instances);
    EXPECT_EQ(result.threads, std::min(config.instances, omp_get_max_threads()));
    EXPECT_EQ(result.state_hash, summary.state_hash);
    EXPECT_NEAR(result.newton_iterations, summary.newton_iterations.mean(), kRounding * result.newton_iterations);
  }
}

TEST_F(BenchTest, StepsThatAreGivenAreTaken) {
  EXPECT_EQ(measured("", 100).steps, 100) << "beyond the scene's";
  EXPECT_EQ(measured("", 1).steps, 1);
  const std::int64_t own = measured("", std::nullopt).steps;
  EXPECT_GE(own, 1);
  EXPECT_LE(own, 30) << "the scene's, or what there is time for";
}

TEST_F(BenchTest, ANonFiniteStepIsAFailure) {
  SceneConfig config = scene(", \"forces\": [{\"vertices\": {\"ids\": [15]}, \"force\": [0, 1, 0]}]");
  config.forces.front().force[1] = 1e300;
  const test::LoadedRun loaded(config);
  EXPECT_THROW(bench(loaded.world, loaded.config, {.seconds = 0.01}), WorkError);
}

}  // namespace
}  // namespace exmat::runtime
