#include <cstring>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "common/bundle/bundle.h"
#include "common/config/config.h"
#include "common/hdf5/hdf5_file.h"
#include "precompute/full_space/full_space_stepper.h"
#include "precompute/full_space/scene_setup.h"
#include "runtime/scene/obstacle_loader.h"
#include "runtime/scene/scene_loader.h"
#include "tests/integration/support.h"

namespace exmat::test {
namespace {

using namespace nlohmann::literals;
using ::testing::HasSubstr;

class FullSpaceProgram : public testing::Test {
 protected:
  void make(const Json& scene, const Json& asset = Json::object()) {
    const Outcome outcome =
        exmat_precompute({"bundle", write_small_bar(folder_, asset), "-o", folder_.path("bundle.h5")});
    ASSERT_EQ(outcome.status, 0) << outcome.errors;
    write_scene(folder_, scene);
  }
  Outcome full_space(std::vector<std::string> options = {}) const {
    options.insert(options.begin(), {"full-space", folder_.path("scene.json"), "-o", folder_.path("full.h5")});
    return exmat_precompute(options);
  }
  std::vector<float> positions(const std::string& name) const {
    const Hdf5File file = Hdf5File::open(folder_ / name);
    const Hdf5Dataset dataset = file.open_dataset("/vertices");
    std::vector<float> found(dataset.element_count());
    dataset.read(found.data(), ElementType::kFloat32);
    return found;
  }

  /// Mean distance of the frames of a run of the scene from those of full.h5, over the largest displacement there.
  double error_of_run(Json scene, const char* space, Eigen::Index frames) const {
    scene["space"] = space;
    scene["output"]["trajectory"] = "run.h5";
    write_scene(folder_, scene);
    const Outcome outcome = exmat_runtime({"run", folder_.path("scene.json")});
    EXPECT_EQ(outcome.status, 0) << outcome.errors;
    const std::vector<float> found = positions("run.h5"), expected = positions("full.h5");
    const auto size = static_cast<Eigen::Index>(found.size()) / frames;
    const Eigen::Map<const Eigen::MatrixXf> a(found.data(), size, frames), b(expected.data(), size, frames);
    return (a - b).colwise().norm().mean() / (b.colwise() - b.col(0)).colwise().norm().maxCoeff();
  }

  TemporaryFolder folder_;
};

const Json kScene = R"({ "time_step": 0.01, "steps": 12, "gravity": [0, -2, 1], "damping": { "mass": 0.5 },
                         "examples": { "stiffness": 300, "damping": 5, "bias": 0.7 }, "output": { "every": 3 } })"_json;

// Step by step with the full space's own functions, from the same files.
TEST_F(FullSpaceProgram, WritesTheMotionOfTheFullSpace) {
  make(kScene);
  const Outcome outcome = full_space({"--steps", "8"});
  ASSERT_EQ(outcome.status, 0) << outcome.errors;
  EXPECT_THAT(outcome.output, HasSubstr("full.h5, 3 frames")) << "every third of the scene";
  const SceneConfig config = load_scene(folder_.path("scene.json"));
  const ReducedModel data = read_bundle(config.bundle);
  const auto model = precompute::build_full_space_model(data, precompute::full_space_options(config));
  const auto scene = precompute::full_space_scene(config, runtime::make_obstacles(config), model);
  auto state = precompute::full_space_start(config, model, Eigen::VectorXd::Zero(model.rest.size()));
  precompute::FullSpaceStepper stepper(model);
  stepper.set(scene);
  const std::vector<float> found = positions("full.h5");
  const auto size = static_cast<std::size_t>(model.rest.size());
  ASSERT_EQ(found.size(), 3 * size);
  for (std::size_t k = 0; k < 3; ++k) {
    const VertexArray expected = precompute::world_positions(model, state);
    for (std::size_t i = 0; i < size; ++i)
      ASSERT_EQ(found[k * size + i], static_cast<float>(expected.data()[i])) << k << " " << i;
    for (int i = 0; i < 3; ++i) stepper.step(state);
  }
  EXPECT_THAT(read_file(folder_.path("full.xdmf")), HasSubstr("full.h5:/vertices"));
}

// Both with the pushes of the scene, which the basis has not learned: in space `full` the run is the reference, but for
// the few iterations of a step and what a lag of the target by their ends makes of it, and in space `auto` while the
// push acts. The reduced run is not.
TEST_F(FullSpaceProgram, IsWhatARunInAllVerticesFinds) {
  Json scene = kScene;
  scene["time_step"] = 0.004;
  scene["steps"] = 100;
  scene["output"] = {{"every", 1}};
  scene["forces"] = {{{"vertices", {{"ids", {30, 31}}}}, {"force", {0, 2, 1}}, {"start", 0.04}, {"end", 0.3}}};
  make(scene);
  ASSERT_EQ(full_space().status, 0);
  EXPECT_LE(error_of_run(scene, "full", 101), 0.005);
  EXPECT_LE(error_of_run(scene, "auto", 101), 0.03);
  EXPECT_GE(error_of_run(scene, "reduced", 101), 0.05);
}

// The same of settings that change, some on a line and some at once; with the values of their first keys throughout the
// run is elsewhere.
TEST_F(FullSpaceProgram, ChangesKeyedSettingsAsARunInAllVertices) {
  Json scene = kScene;
  scene["time_step"] = 0.004;
  scene["steps"] = 100;
  scene["output"] = {{"every", 1}};
  scene["gravity"] = R"({ "keys": [ { "time": 0, "value": [0, -2, 1] }, { "time": 0.2, "value": [0, 1, 1] } ] })"_json;
  scene["examples"] = R"({ "damping": 5,
      "stiffness": { "keys": [ { "time": 0, "value": 300 }, { "time": 0.25, "value": 150 } ], "interpolation": "step" },
      "weights": { "keys": [ { "time": 0.05, "value": [1, 0] }, { "time": 0.2, "value": [0.2, 0.8] } ] } })"_json;
  make(scene);
  const Outcome outcome = full_space();
  ASSERT_EQ(outcome.status, 0) << outcome.errors;
  EXPECT_LE(error_of_run(scene, "full", 101), 0.002);
  for (const Json& constant : {R"({ "gravity": [0, -2, 1] })"_json, R"({ "examples": { "stiffness": 300 } })"_json,
                               R"({ "examples": { "weights": [1, 0] } })"_json}) {
    Json other = scene;
    other.merge_patch(constant);
    EXPECT_GE(error_of_run(other, "full", 101), 0.01) << constant;
  }
}

TEST_F(FullSpaceProgram, RefusesWhatABodyInAllVerticesCannotHave) {
  make(kScene);
  const auto refusal = [&](const Json& members) {
    Json scene = kScene;
    scene["space"] = "full";
    if (!members.empty()) scene.update(members);
    write_scene(folder_, scene);
    const Outcome outcome = exmat_runtime({"run", folder_.path("scene.json")});
    EXPECT_EQ(outcome.status, 2);
    return outcome.errors;
  };
  EXPECT_THAT(refusal({{"space", "ful"}}), HasSubstr("/space"));
  EXPECT_THAT(refusal({{"space_release", 0}}), HasSubstr("/space_release"));
  Json lean = kScene;
  write_scene(folder_, lean);
  ASSERT_EQ(exmat_precompute({"bundle", folder_.path("asset.json"), "-o", folder_.path("bundle.h5"), "--scene",
                              folder_.path("scene.json")})
                .status,
            0);
  EXPECT_THAT(refusal(Json::object()), HasSubstr("/full_space: expected the group"));
}

// The tools of reduced trajectories read it, and it is near the reduced motion of the same scene.
TEST_F(FullSpaceProgram, IsReadAsAnyTrajectory) {
  make({{"time_step", 0.01},
        {"steps", 10},
        {"gravity", {0, -2, 1}},
        {"output", {{"trajectory", "reduced.h5"}, {"every", 1}}}},
       {{"basis", {{"size", 20}, {"linear_modes", 14}}},
        {"cubature", {{"method", "all_elements"}, {"elements", nullptr}}}});
  ASSERT_EQ(full_space().status, 0);
  ASSERT_EQ(exmat_runtime({"run", folder_.path("scene.json")}).status, 0);
  const std::vector<float> full = positions("full.h5"), reduced = positions("reduced.h5");
  ASSERT_EQ(full.size(), reduced.size());
  const std::size_t size = full.size() / 11;
  double distance = 0, way = 0;
  for (std::size_t i = 0; i < size; ++i) {
    distance += std::pow(full[10 * size + i] - reduced[10 * size + i], 2);
    way += std::pow(full[10 * size + i] - full[i], 2);
  }
  EXPECT_GT(way, 0) << "it does not move";
  EXPECT_LE(std::sqrt(distance / way), 0.05) << "of gravity, which twenty modes follow to a few percent";

  ASSERT_EQ(exmat_runtime({"export", folder_.path("full.h5"), "-o", folder_.path("full.pc2")}).status, 0);
  const std::string cache = read_file(folder_.path("full.pc2"));
  ASSERT_EQ(cache.size(), 32 + full.size() * sizeof(float)) << "a header of 32 bytes, then all positions";
  EXPECT_EQ(std::memcmp(cache.data() + 32, full.data(), full.size() * sizeof(float)), 0);
}

TEST_F(FullSpaceProgram, RefusesWhatItCannotRun) {
  make(kScene, {{"needs", Json::array({"examples"})}});  // not contact
  const auto refused = [&](const Json& members, const std::vector<std::string>& options, const std::string& message) {
    write_scene(folder_, members);
    const Outcome outcome = full_space(options);
    EXPECT_EQ(outcome.status, 2) << message;
    EXPECT_THAT(outcome.errors, HasSubstr(message));
    EXPECT_FALSE(std::filesystem::exists(folder_.path("full.h5")));
    EXPECT_FALSE(std::filesystem::exists(folder_.path("full.xdmf")));
  };
  refused({{"time_stepp", 0.01}}, {}, "did you mean \"time_step\"?");
  refused({{"bundle", "none.h5"}}, {}, "none.h5");
  refused({{"bundle", "scene.json"}}, {}, "scene.json");
  refused({{"forces", {{{"vertices", {{"ids", {5000}}}}, {"force", {0, 0, 1}}}}}}, {},
          "scene.json: /forces/0/vertices");
  refused({{"obstacles", {{{"plane", {{"point", {0, 0, -1}}, {"normal", {0, 0, 1}}}}}}}}, {}, "/contact");
  refused({{"body", {{"motion", {{{"time", 0}}, {{"time", 1}, {"position", {1, 0, 0}}}}}}}}, {}, "/body/motion");
  refused(R"({ "examples": { "stiffness": 1, "weights": { "keys": [ { "time": 0, "value": [1, 0, 0] } ] } } })"_json,
          {}, "/examples/weights: expected 2 numbers, one for each example");
  refused(R"({ "examples": { "stiffness": 1, "compensate": true } })"_json, {},
          "/examples/compensate: expected false: targets of the full-space reference are not compensated");
  refused(Json::object(), {"--steps", "0"}, "--steps");
  refused(Json::object(), {"--every", "x"}, "--every");
  const std::string bundle = read_file(folder_.path("bundle.h5"));
  const auto to = [&](const char* name) {
    return exmat_precompute({"full-space", folder_.path("scene.json"), "-o", folder_.path(name)});
  };
  write_scene(folder_, Json::object());
  EXPECT_EQ(to("bundle.h5").status, 2);
  EXPECT_THAT(to("bundle.h5").errors, HasSubstr("bundle.h5: -o: expected a file that this command does not read"));
  EXPECT_EQ(read_file(folder_.path("bundle.h5")), bundle);
  EXPECT_EQ(to("full.xdmf").status, 2);
  EXPECT_THAT(to("full.xdmf").errors, HasSubstr("give it the extension .h5"));
  EXPECT_FALSE(std::filesystem::exists(folder_.path("full.xdmf")));
  EXPECT_EQ(exmat_precompute({"full-space", folder_.path("scene.json")}).status, 2) << "no output";
  EXPECT_EQ(exmat_precompute({"full-space", folder_.path("none.json"), "-o", folder_.path("full.h5")}).status, 2);
}

}  // namespace
}  // namespace exmat::test
