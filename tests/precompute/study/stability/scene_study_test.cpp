#include "precompute/study/stability/scene_study.h"

#include <cmath>
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "common/bundle/bundle.h"
#include "common/config/config.h"
#include "common/core/error.h"
#include "precompute/study/stability/scene_variants.h"
#include "runtime/scene/scene_run.h"
#include "tests/precompute/full_space/full_space_bar.h"
#include "tests/support/temporary_folder.h"

namespace exmat::precompute {
namespace {

using namespace nlohmann::literals;
using nlohmann::json;
using ::testing::AllOf;
using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::Not;

const CheckResult& at(const CheckResults& checks, Check check) { return checks[static_cast<std::size_t>(check)]; }

/// A record that passes every check by a hair, for each check one that fails it by one.
TEST(StabilityChecks, FailJustAboveTheirLimits) {
  RunRecord sound{.exchanged = 2,
                  .kinetic = 1e-6,
                  .peak_kinetic = 1,
                  .gain = 2e-9,
                  .displacement = 5,
                  .momentum_error = 1e-9,
                  .steps = 100,
                  .unsolved = 1};
  const Expectation all{
      .displacement = 5, .rest = true, .energy = true, .momentum = true, .integrator = Integrator::kBackwardEuler};
  EXPECT_EQ(gravest(judge(sound, all)), Verdict::kPass);
  const auto fails = [&](Check check, auto spoil) {
    RunRecord spoilt = sound;
    spoil(spoilt);
    const CheckResults checks = judge(spoilt, all);
    for (std::size_t i = 0; i < checks.size(); ++i)
      EXPECT_EQ(checks[i].verdict == Verdict::kFail, i == static_cast<std::size_t>(check)) << kCheckNames[i];
  };
  fails(Check::kFinite, [](RunRecord& run) { run.non_finite = 1; });
  fails(Check::kBounded, [](RunRecord& run) { run.displacement = 5.001; });
  fails(Check::kSolved, [](RunRecord& run) { run.unsolved = 2; });
  fails(Check::kRest, [](RunRecord& run) { run.kinetic = 1.001e-6; });
  fails(Check::kEnergy, [](RunRecord& run) { run.gain = 2.001e-9; });
  fails(Check::kMomentum, [](RunRecord& run) { run.momentum_error = 1.001e-9; });
  sound.gain = 1.9e-6;
  EXPECT_EQ(gravest(judge(sound, {.displacement = 5, .energy = true})), Verdict::kPass) << "bdf2 may gain more";
}

TEST(StabilityChecks, RecordKeepsExtremes) {
  RunRecord run{.start_energy = 10, .start_potential = 4};
  EXPECT_TRUE(run.add({.unsolved = 1, .displacement = 2, .kinetic = 5, .energies = {5, 4, 4}, .work = 1}));
  EXPECT_TRUE(run.add({.displacement = 1, .kinetic = 3, .energies = {3, 1, 9}, .work = 0}));
  EXPECT_EQ(run.gain, 3) << "13 J less the work, from 10 J";
  EXPECT_EQ(run.exchanged, 9);
  EXPECT_EQ(run.displacement, 2);
  EXPECT_EQ(run.kinetic, 3);
  EXPECT_EQ(run.peak_kinetic, 5);
  EXPECT_EQ(run.steps, 2);
  EXPECT_FALSE(run.add({.non_finite = 1}));
  EXPECT_EQ(run.steps, 2);
}

class SceneStudyTest : public testing::Test {
 protected:
  void make(const test::BarOptions& options, bool contact = false) {
    bar_ = complete_bar(options);
    if (contact) bar_.model.contact = test::surface_contact(bar_.model);
    write_bundle(bar_.model, folder_ / "bar.h5");
  }
  std::filesystem::path scene(const json& members) {
    json content = R"({ "bundle": "bar.h5", "time_step": 0.01, "steps": 60, "gravity": [0, 0, -9.81] })"_json;
    content.merge_patch(members);
    return folder_.write("scene.json", content.dump());
  }
  static const SafeRange& range(const SceneStudy& study, const std::string& dimension) {
    return *std::ranges::find(study.ranges, dimension, &SafeRange::dimension);
  }
  static const SceneRun& run(const SceneStudy& study, const std::string& dimension, const std::string& variant) {
    return *std::ranges::find_if(
        study.runs, [&](const SceneRun& one) { return one.dimension == dimension && one.variant == variant; });
  }
  /// The pose of the vertices that a start stands for.
  VertexArray pose(const SceneDimension& starts, const std::string& name) const {
    const auto found = std::ranges::find(starts.variants, name, &SceneVariant::name);
    const Eigen::VectorXd u = bar_.model.modal->basis * *found->scene.bodies[0].scene.body.reduced;
    const VertexArray& rest = bar_.model.object->mesh.vertices;
    return rest + u.reshaped<Eigen::RowMajor>(rest.rows(), 3);
  }

  test::TemporaryFolder folder_;
  test::Bar bar_;
};

// Two iterations do for short steps alone. Runs of the run time itself say for which.
TEST_F(SceneStudyTest, SafeTimeStepIsTheLargestThatRunsConvergeWith) {
  make({.cells = {3, 1, 1}});
  const auto file =
      scene({{"time_step", 0.002}, {"steps", 400}, {"newton", {{"max_iterations", 2}, {"tolerance", 1e-9}}}});
  const SceneStudy study = study_scene(file);
  std::string safe = "none";
  bool still = true;
  for (const double factor : {1.0, 2.0, 4.0, 8.0, 16.0}) {
    SceneConfig config = load_scene(file);
    config.time_step *= factor;
    config.steps = std::llround(400 / factor);
    const WorldConfig world = world_of(config);
    const runtime::RunSummary summary = runtime::run(runtime::load_world_run(world), world);
    const double share = static_cast<double>(summary.unconverged_steps) / static_cast<double>(summary.steps);
    const std::string name = fmt::format("{:g} x", factor);
    const SceneRun& own = factor == 1 ? study.runs.front() : run(study, "time step", name);
    EXPECT_DOUBLE_EQ(at(own.checks, Check::kSolved).value, share) << name;
    still &= share <= 0.01;
    if (still) safe = name;
  }
  EXPECT_FALSE(still) << "none fails";
  EXPECT_NE(safe, "none");
  EXPECT_EQ(range(study, "time step").safe, safe);
  EXPECT_THAT(range(study, "time step").fails, HasSubstr("16 x: solved"));
}

TEST_F(SceneStudyTest, AScenesOwnFailureIsItsHeadline) {
  make({.cells = {2, 1, 1}});
  const SceneStudy study = study_scene(scene({{"time_step", 1e-160}}));
  EXPECT_THAT(study.headline(), AllOf(HasSubstr("FAILS as it is"), HasSubstr("finite 1")));
  EXPECT_EQ(range(study, "time step").safe, "none");
}

TEST_F(SceneStudyTest, SaysWhatItLeavesOut) {
  make({.cells = {2, 1, 1}});
  const SceneStudy study = study_scene(scene({{"gravity", {0, 0, 0}}}));
  for (const char* dimension : {"load", "speed", "kappa", "contact stiffness"}) {
    EXPECT_THAT(range(study, dimension).safe, HasSubstr("not tested"));
    EXPECT_THAT(study.not_tested, Contains(HasSubstr(dimension)));
  }
  EXPECT_EQ(range(study, "time step").safe, "16 x and more");
  EXPECT_THAT(scene_study_markdown(study), HasSubstr("| start | as the scene has it |"));
}

// A body that spins in free flight: its momentum is asked for, and kept.
TEST_F(SceneStudyTest, MomentumOfAFreeBodyIsKept) {
  make({.cells = {2, 1, 1}, .free = true});
  const SceneStudy study =
      study_scene(scene({{"body", {{"linear_velocity", {0, 0, 2}}, {"angular_velocity", {1, 3, 0.5}}}}}));
  for (const SceneRun& one : study.runs) {
    EXPECT_EQ(at(one.checks, Check::kMomentum).verdict, Verdict::kPass) << one.dimension << one.variant;
    EXPECT_NE(at(one.checks, Check::kEnergy).verdict, Verdict::kNotApplicable) << one.dimension << one.variant;
  }
  EXPECT_EQ(at(study.runs.front().checks, Check::kEnergy).verdict, Verdict::kPass);
  EXPECT_EQ(range(study, "speed").own, "2 m/s, 3.202 rad/s");
  EXPECT_THAT(range(study, "speed").safe, Not(HasSubstr("not tested")));
}

// Every run is asked to come to rest where the scene itself does, and starts are asked to come back to where it ends.
TEST_F(SceneStudyTest, StartsComeBackToWhereTheSceneEnds) {
  make({.cells = {2, 1, 1}, .material = MaterialModel::kStableNeoHookean});
  const json damped{{"damping", {{"mass", 20}, {"stiffness", 0.02}}}, {"steps", 600}};
  const SceneStudy study = study_scene(scene(damped));
  EXPECT_THAT(study.not_tested, Not(Contains(HasSubstr("rest, return"))));
  const CheckResult& back = at(run(study, "start", "random").checks, Check::kReturn);
  EXPECT_EQ(back.verdict, Verdict::kPass);
  EXPECT_LT(back.value, 1e-3);
  EXPECT_EQ(at(run(study, "load", "10 x").checks, Check::kRest).verdict, Verdict::kPass);
  EXPECT_EQ(at(run(study, "load", "10 x").checks, Check::kReturn).verdict, Verdict::kNotApplicable);
  const SceneStudy still_moving = study_scene(scene({{"steps", 20}}));
  EXPECT_THAT(still_moving.not_tested, Contains(HasSubstr("rest, return: the scene itself does not come to rest")));
}

// A bar with all its modes, clamped at x = 0, along which it is longest.
TEST_F(SceneStudyTest, StartsAreTheBodyFlatAndMirrored) {
  make({.cells = {3, 1, 1}});
  const WorldConfig config = load_world(scene(json::object()));
  const SceneDimension starts = scene_dimensions(config, SceneBodies(config)).back();
  ASSERT_EQ(starts.variants.size(), 3U);
  const VertexArray& rest = bar_.model.object->mesh.vertices;
  VertexArray flat = rest, mirrored = rest;
  flat.col(0).setZero();
  mirrored.col(0) *= -1;
  EXPECT_LE((pose(starts, "flat") - flat).lpNorm<Eigen::Infinity>(), 1e-9);
  EXPECT_LE((pose(starts, "mirrored") - mirrored).lpNorm<Eigen::Infinity>(), 1e-9);
  const double farthest = (pose(starts, "random") - rest).rowwise().norm().maxCoeff();
  EXPECT_NEAR(farthest, (rest.colwise().maxCoeff() - rest.colwise().minCoeff()).norm(), 1e-9);
}

TEST_F(SceneStudyTest, VariantsChangeOneThing) {
  make({.cells = {2, 1, 1}, .examples = 3}, /*contact=*/true);
  const WorldConfig config = load_world(scene(R"({
      "examples": { "stiffness": 50 }, "forces": [ { "vertices": { "ids": [3] }, "force": [1, 2, 3] } ],
      "obstacles": [ { "plane": { "point": [0, 0, -5], "normal": [0, 0, 1] }, "stiffness": 1e6 } ] })"_json));
  const auto dimensions = scene_dimensions(config, SceneBodies(config));
  const auto changed = [&](const std::string& dimension, const std::string& variant) {
    const auto found = std::ranges::find(dimensions, dimension, &SceneDimension::name);
    return std::ranges::find(found->variants, variant, &SceneVariant::name)->scene.bodies[0].scene;
  };
  EXPECT_EQ(changed("time step", "16 x").time_step, 0.16);
  EXPECT_EQ(changed("time step", "16 x").steps, 4);
  EXPECT_EQ(changed("time step", "1/4 x").steps, 240);
  EXPECT_EQ(changed("load", "100 x").gravity, Eigen::Vector3d(0, 0, -981));
  EXPECT_EQ(changed("load", "100 x").forces[0].force, Eigen::Vector3d(100, 200, 300));
  EXPECT_EQ(changed("load", "100 x").time_step, 0.01);
  EXPECT_EQ(changed("kappa", "10 x").examples->stiffness, 500);
  EXPECT_EQ(changed("contact stiffness", "10 x").obstacles[0].stiffness, 1e7);
  EXPECT_EQ(changed("contact stiffness", "10 x").gravity, Eigen::Vector3d(0, 0, -9.81));
}

TEST_F(SceneStudyTest, ResultsDoNotDependOnTheNumberOfJobs) {
  make({.cells = {2, 1, 1}});
  const auto file = scene({{"steps", 30}});
  write_scene_study(study_scene(file, 1), folder_ / "one");
  write_scene_study(study_scene(file, 2), folder_ / "two");
  for (const char* name : {"stability.html", "stability.md", "stability.csv", "stability.json"})
    EXPECT_EQ(test::read_file(folder_ / "one" / name), test::read_file(folder_ / "two" / name)) << name;
}

TEST_F(SceneStudyTest, RefusesABundleWithoutTheMesh) {
  make({.cells = {2, 1, 1}});
  bar_.model.object.reset();
  write_bundle(bar_.model, folder_ / "bar.h5");
  EXPECT_THROW(study_scene(scene(json::object())), InputError);
}

}  // namespace
}  // namespace exmat::precompute
