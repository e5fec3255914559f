#include <cmath>
#include <gtest/gtest.h>

#include "common/config/config.h"
#include "common/core/error.h"
#include "precompute/full_space/scene_setup.h"
#include "runtime/scene/obstacle_loader.h"
#include "runtime/scene/scene_loader.h"
#include "runtime/sim/step/stepper.h"
#include "tests/integration/support.h"
#include "tests/support/sparse_space/sparse_model.h"

namespace exmat::test {
namespace {

using namespace nlohmann::literals;

class ReferenceFiles : public testing::Test {
 protected:
  /// The bar in little with `size` modes, in the bundle of the scenes.
  ReducedModel built(int size, const Json& changes = Json::object()) {
    Json asset = {{"basis", {{"size", size}, {"linear_modes", 14}}}, {"cubature", {{"training_poses", 40}}}};
    asset.merge_patch(changes);
    return through_bundle(build(write_small_bar(folder_, asset)).model, folder_.path("bundle.h5"));
  }

  TemporaryFolder folder_;
};

// The bundle has an example's pose in full space, seen from the basis.
TEST_F(ReferenceFiles, ExamplePosesAreThoseOfTheBundleBeforeTheirReduction) {
  for (const Json& object : {R"({})"_json, R"({"fixed": null})"_json}) {
    const ReducedModel model = built(12, {{"object", object}});
    const auto system =
        precompute::build_elastic_system(model.object->mesh, model.object->materials, model.object->fixed);
    const auto poses = precompute::whole_body_example_poses(model, system);
    const Eigen::MatrixXd reduce = (system.mass * system.restrict(model.modal->basis)).transpose();
    const precompute::FullSpaceExamples examples(model, system, poses, EnergyReference::kExample);
    const ExampleData& twist = model.examples->examples[1];
    const Eigen::VectorXd pose = examples.pose_basis() * examples.pose(1);
    EXPECT_LE((reduce * pose - twist.pose).norm(), 1e-9 * twist.pose.norm()) << object;
    EXPECT_GT(pose.lpNorm<Eigen::Infinity>(), 0.05) << "no pose";
  }
}

/// RMS distance of the reduced trajectory from that of the full space, relative to the RMS displacement, M-norm.
double trajectory_error(const SceneConfig& config, const ReducedModel& data, int steps) {
  const auto loaded = runtime::load_run(config);
  const auto model = precompute::build_sparse_model(data, precompute::full_space_options(config));
  const auto scene = precompute::full_space_scene(config, runtime::make_obstacles(config), model);
  runtime::State reduced = loaded.start;
  runtime::Workspace reduced_workspace(*loaded.model, loaded.scene);
  auto state = precompute::full_space_start(config, model, data.modal->basis * reduced.q);
  precompute::SparseWorkspace workspace(model);
  double distance = 0, size = 0;
  for (int i = 0; i < steps; ++i) {
    EXPECT_EQ(runtime::step(*loaded.model, loaded.scene, reduced, reduced_workspace).status, 0U) << i;
    EXPECT_EQ(precompute::step(model, scene, state, workspace).status, 0U) << i;
    const Eigen::VectorXd u = model.system.extend(state.q), difference = data.modal->basis * reduced.q - u;
    distance += difference.dot(model.system.full_mass * difference);
    size += u.dot(model.system.full_mass * u);
  }
  return std::sqrt(distance / size);
}

// Internal forces are exact, by the polynomial: what is left is the basis.
TEST_F(ReferenceFiles, AReducedSceneComesNearerToTheFullOneWithMoreModes) {
  const auto scene = write_scene(folder_, R"({
    "time_step": 0.01, "gravity": [0, -2, 1], "internal_force": "polynomial",
    "damping": { "mass": 0.5, "stiffness": 0.001 },
    "forces": [ { "vertices": { "ids": [8, 17] }, "force": [0, 0, 300], "start": 0.2, "end": 0.5 } ] })"_json);
  std::vector<double> errors;
  for (const int size : {6, 14, 30}) {
    const ReducedModel data = built(size, {{"internal_force", "polynomial"}});
    errors.push_back(trajectory_error(load_scene(scene), data, 100));
    RecordProperty("error_r" + std::to_string(size), std::to_string(errors.back()));
  }
  EXPECT_LT(errors[1], errors[0]);
  EXPECT_LT(errors[2], 0.3 * errors[1]);
  EXPECT_LE(errors[2], 0.01);
}

TEST_F(ReferenceFiles, RefusesWhatItCannotDo) {
  ReducedModel data = built(8);
  data.contact.reset();
  const auto model = precompute::build_sparse_model(data);
  for (const Json& members :
       {R"({"body": {"motion": [{"time": 0, "position": [0, 0, 0]}, {"time": 1, "position": [1, 0, 0]}]}})"_json,
        R"({"examples": {"stiffness": 1}})"_json, R"({"obstacles": [{"plane": {"normal": [0, 1, 0]}}]})"_json,
        R"({"forces": [{"vertices": {"ids": [100000]}, "force": [1, 0, 0]}]})"_json}) {
    const SceneConfig config = load_scene(write_scene(folder_, members));
    EXPECT_THROW(precompute::full_space_scene(config, {}, model), InputError) << members;
  }
  const SceneConfig moved = load_scene(write_scene(folder_, R"({"body": {"linear_velocity": [1, 0, 0]}})"_json));
  EXPECT_THROW(precompute::full_space_start(moved, model, Eigen::VectorXd::Zero(model.rest.size())), InputError);
}

}  // namespace
}  // namespace exmat::test
