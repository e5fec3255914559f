#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "common/bundle/bundle.h"
#include "common/config/config.h"
#include "common/core/error.h"
#include "common/hdf5/hdf5_file.h"
#include "runtime/scene/scene_run.h"
#include "tests/support/scene_run.h"
#include "tests/support/scenes.h"
#include "tests/support/temporary_folder.h"

// Scenes whose bodies reach for places, beside a host that sets the weights and beside where given weights settle.
namespace exmat::runtime {
namespace reach_run_test {

using ::testing::HasSubstr;

class ReachRun : public ::testing::Test {
 protected:
  ReachRun() {
    for (const bool free : {false, true}) bars_[free ? 1 : 0] = write(free ? "free.h5" : "bar.h5", free);
  }
  test::Bar write(const char* name, bool free) const {
    test::Bar bar = full_bar({.youngs_modulus = 4e5, .free = free, .examples = 3});
    write_bundle(bar.model, folder_.path(name));
    return bar;
  }
  SceneConfig scene(const std::string& members, const char* bundle = "bar.h5") const {
    return load_scene(folder_.write(
        "scene.json", std::string(R"({"time_step": 0.004, "steps": 400, "damping": {"mass": 12, "stiffness": 0.002},
            "bundle": ")") +
                          bundle + "\", " + members + "}"));
  }
  /// The place of the bar's far corner where these weights settle it [m].
  Eigen::Vector3d settled(const char* weights) const {
    const test::LoadedRun loaded(scene(std::string(R"("examples": {"stiffness": 400, "weights": )") + weights + "}"));
    Bodies bodies = loaded.bodies();
    for (int i = 0; i < 400; ++i) bodies.step();
    return corner(bodies.world().state(0));
  }
  Eigen::Vector3d corner(const State& state) const {
    const Eigen::Index last = bars_[0].model.object->mesh.vertex_count() - 1;
    return bars_[0].model.object->mesh.vertices.row(last).transpose() +
           bars_[0].basis().middleRows<3>(3 * last) * state.q;
  }
  std::string target(const Eigen::Vector3d& place) const {
    return fmt::format(R"({{"vertices": {{"ids": [{}]}}, "position": [{:.17g}, {:.17g}, {:.17g}]}})",
                       bars_[0].model.object->mesh.vertex_count() - 1, place[0], place[1], place[2]);
  }
  std::string refusal(const std::string& members) const {
    try {
      const test::LoadedRun loaded(scene(members));
    } catch (const InputError& error) {
      return error.what();
    }
    return "none";
  }

  test::TemporaryFolder folder_;
  test::Bar bars_[2];
};

// The place is where weights that no method chose have settled the body; the target jumps at 0.8 s.
TEST_F(ReachRun, ComesToPlacesThatGoAlongKeys) {
  const Eigen::Vector3d first = settled("[0.4, 0.6, 0]"), last = settled("[0.2, 0.3, 0.5]");
  const std::string position = fmt::format(
      R"("position": {{"keys": [{{"time": 0, "value": [{:.17g}, {:.17g}, {:.17g}]}},
                                {{"time": 0.8, "value": [{:.17g}, {:.17g}, {:.17g}]}}], "interpolation": "step"}})",
      first[0], first[1], first[2], last[0], last[1], last[2]);
  const SceneConfig config = scene(fmt::format(R"("examples": {{"stiffness": 400}}, "instances": 2,
                     "reach": {{"targets": [{{"vertices": {{"ids": [{}]}}, {}}}], "change": 0.02}},
                     "output": {{"trajectory": "t.h5", "every": 1}})",
                                               bars_[0].model.object->mesh.vertex_count() - 1, position));
  const test::LoadedRun loaded(config);
  Bodies bodies = loaded.bodies();
  const double size = bars_[0].length;
  for (int i = 0; i < 199; ++i) bodies.step();
  for (const int body : {0, 1}) EXPECT_LE((corner(bodies.world().state(body)) - first).norm(), 2e-3 * size) << body;
  EXPECT_GE((last - first).norm(), 0.02 * size);
  for (int i = 0; i < 300; ++i) bodies.step();
  for (const int body : {0, 1}) EXPECT_LE((corner(bodies.world().state(body)) - last).norm(), 2e-3 * size) << body;

  const RunSummary summary = loaded.run();
  EXPECT_EQ(summary.unconverged_steps, 0);
  const Hdf5File file = Hdf5File::open(folder_ / "t.h5");
  std::vector<double> weights(3 * 401);
  file.open_dataset("/examples/weights").read(weights.data(), ElementType::kFloat64);
  for (std::size_t k = 2; k < 401; ++k)
    for (std::size_t i = 0; i < 3; ++i)
      EXPECT_LE(std::abs(weights[3 * k + i] - weights[3 * k - 3 + i]), 0.02 + 1e-9) << k;
}

// A host's loop is the same to the bit, and so is a run that goes on from a state file.
TEST_F(ReachRun, IsTheRunOfAHostThatChooses) {
  const Eigen::Vector3d place = settled("[0.4, 0.6, 0]");
  const SceneConfig config =
      scene(R"("examples": {"stiffness": 400}, "gravity": [0, 0, -2], "reach": {"targets": [)" + target(place) +
            R"(], "lowest": [0.1, 0, 0], "highest": [1, 1, 0.2], "horizon": 0.4})");
  const test::LoadedRun loaded(config);
  const LoadedScene& kind = loaded.kind();
  StepScene chosen = kind.scene;
  State state = kind.start;
  Workspace workspace(*kind.model, chosen);
  refresh_weights(*kind.model, chosen, state, workspace);
  const Eigen::Index last = bars_[0].model.object->mesh.vertex_count() - 1;
  Reach reach(*kind.model, chosen, state,
              {0, bars_[0].model.object->mesh.vertices.row(last), bars_[0].basis().middleRows<3>(3 * last), place,
               Eigen::Vector3d(0.1, 0, 0), Eigen::Vector3d(1, 1, 0.2), 0.05, 0.4});
  for (int i = 0; i < 400; ++i) {
    reach.choose_weights(chosen);
    step(*kind.model, chosen, state, workspace);
  }
  FnvHash hash;
  add_to_hash(*kind.model, state, hash);
  const RunSummary summary = loaded.run();
  EXPECT_EQ(summary.state_hash, hash.value());
  ASSERT_TRUE(summary.farthest_reach);
  EXPECT_NEAR(*summary.farthest_reach, (corner(state) - place).norm(), 1e-12);

  RunOptions half{.dump_state = folder_ / "half.json"};
  SceneConfig first = config;
  first.steps = 150;
  test::run(first, half);
  SceneConfig second = config;
  second.steps = 250;
  EXPECT_EQ(test::run(second, {.from_state = folder_ / "half.json"}).state_hash, hash.value());
}

// All vertices together are the centre of mass: modes of a free body have no momentum, so no mode moves it.
TEST_F(ReachRun, TakesMeansByMass) {
  const test::LoadedRun loaded(scene(R"("examples": {"stiffness": 400}, "reach": {"targets": [{"position": [0, 0, 1],
               "vertices": {"box": {"min": [-9, -9, -9], "max": [9, 9, 9]}}}]})",
                                     "free.h5"));
  const ReachTargets& targets = loaded.kind().reach->targets;
  EXPECT_LE((targets.rest.row(0).transpose() - bars_[1].model.rigid->centre_of_mass).norm(), 1e-12);
  EXPECT_LE(targets.basis_rows.norm(), 1e-10 * bars_[1].basis().norm());
  EXPECT_EQ(targets.places, Eigen::Vector3d(0, 0, 1));
}

TEST_F(ReachRun, ThatCannotBeIsRefusedWithItsPlace) {
  const std::string one = R"("examples": {"stiffness": 400}, "reach": {"targets": [)" + target({0, 0, 0}) + "]";
  EXPECT_EQ(refusal(one + "}"), "none");
  EXPECT_THAT(refusal(R"("reach": {"targets": [)" + target({0, 0, 0}) + "]}"),
              HasSubstr("/reach: expected a scene with \"examples\""));
  EXPECT_THAT(refusal(one + R"(, "region": "left"})"), HasSubstr("/reach/region: expected no region"));
  EXPECT_THAT(refusal(one + R"(, "lowest": [0, 0]})"), HasSubstr("/reach/lowest: expected 3 numbers"));
  EXPECT_THAT(refusal(one + R"(, "lowest": [0.5, 0.5, 0.5]})"), HasSubstr("/reach: expected limits between which"));
  EXPECT_THAT(refusal(one + R"(, "highest": [0.2, 0.2, 0.2]})"), HasSubstr("/reach: expected limits between which"));
  EXPECT_THAT(refusal(one + R"(, "highest": [1, 1, 2]})"), HasSubstr("/reach/highest/2: expected"));
  EXPECT_THAT(refusal(one + R"(, "change": 0})"), HasSubstr("/reach/change: expected a number > 0"));
  EXPECT_THAT(refusal(one + R"(, "horizon": 0})"), HasSubstr("/reach/horizon: expected a number > 0"));
  EXPECT_THAT(refusal(one + R"(}, "space": "full")"), HasSubstr("/reach: expected a body that steps in its modes"));
  EXPECT_THAT(refusal(R"("examples": {"stiffness": 0}, "reach": {"targets": [)" + target({0, 0, 0}) + "]}"),
              HasSubstr("/reach: expected an example force"));
  EXPECT_THAT(refusal(R"("examples": {"stiffness": 4, "weights": [1, 0, 0]}, "reach": {"targets": [)" +
                      target({0, 0, 0}) + "]}"),
              HasSubstr("/reach: expected examples without weights"));
  EXPECT_THAT(refusal(R"("examples": {"stiffness": 4}, "reach": {"targets": []})"), HasSubstr("/reach/targets"));
  EXPECT_THAT(refusal(R"("examples": {"stiffness": 4}, "reach": {"targets": [{"vertices": {"ids": [9999]},
                         "position": [0, 0, 0]}]})"),
              HasSubstr("/reach/targets/0/vertices"));
  EXPECT_THAT(refusal(R"("examples": {"stiffness": 4}, "reach": {"targets": [{"position": [0, 0, 0],
                         "vertices": {"box": {"min": [-1, -9, -9], "max": [0, 9, 9]}}}]})"),
              HasSubstr("/reach/targets/0/vertices: expected vertices of which some move"));
}

}  // namespace reach_run_test
}  // namespace exmat::runtime
