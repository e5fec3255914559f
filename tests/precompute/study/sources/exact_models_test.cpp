#include "precompute/study/sources/exact_models.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "common/bundle/bundle.h"
#include "common/mesh/assembly.h"
#include "precompute/study/measure/error_metrics.h"
#include "precompute/study/measure/runs.h"
#include "tests/precompute/full_space/full_space_bar.h"
#include "tests/support/temporary_folder.h"

namespace exmat::precompute {
namespace {

using ::testing::HasSubstr;

// A bundle with all modes: nothing but targets and cubature is approximated.
class ExactModels : public testing::Test {
 protected:
  ExactModels() : bar_(complete_bar({.cells = {2, 1, 1}, .examples = 3})) {
    scene_.file = folder_ / "scene.json";
    scene_.bundle = folder_ / "bar.h5";
    scene_.time_step = 0.01;
    scene_.gravity = {0, -12, 4};
    scene_.newton = {60, 1e-10};
    scene_.trajectory = "positions";
    scene_.examples.emplace();
    scene_.examples->stiffness = 400;
    scene_.examples->bias = 0.5;
  }
  double apart(const BodyFrames& a, const BodyFrames& b) const {
    const ObjectData& object = *bar_.model.object;
    return trajectory_errors(a, b, object.mesh.vertices, scalar_mass(object.mesh, object.materials.density), false)
        .position.max;
  }
  BodyFrames reduced(const SceneConfig& scene, const ReducedModel& model) const {
    write_bundle(model, scene.bundle);
    return run_reduced(scene, times_).frames;
  }

  test::TemporaryFolder folder_;
  test::Bar bar_;
  SceneConfig scene_;
  std::vector<double> times_{0.05, 0.1, 0.2, 0.4};
  StageCache cache_;
};

// The reduced body of all modes with exact targets is the full space with targets in the same displacements.
TEST_F(ExactModels, SolveTheTargetsOfTheFullSpace) {
  const auto coordinates = target_coordinates(bar_.model, scene_, 1e-3, 1, cache_);
  ASSERT_EQ(coordinates.size(), 1U);
  const BodyFrames full = run_full_space(scene_, bar_.model, times_, coordinates);
  const BodyFrames all_poses = run_full_space(scene_, bar_.model, times_);
  ReducedModel model = bar_.model;
  use_exact_targets(scene_, coordinates, model);
  EXPECT_LE(apart(reduced(with_exact_targets(scene_), model), full), 1e-7);
  EXPECT_LE(apart(full, all_poses), 1e-3) << "as the tolerance asks for";
}

TEST_F(ExactModels, TakeAllElements) {
  scene_.examples.reset();
  ReducedModel model = bar_.model;
  model.cubature->weights *= 0.5;
  const BodyFrames full = run_full_space(scene_, bar_.model, times_);
  EXPECT_GT(apart(reduced(scene_, model), full), 0.1) << "half of the stiffness";
  use_all_elements(model);
  EXPECT_LE(apart(reduced(scene_, model), full), 1e-7);
}

// Vertices of the pose are those of the object, or are mapped to them.
TEST(Correspondence, IsKnownOfTheObjectsOwnMeshAndOfMaps) {
  const auto model = test::make_bar({.cells = {2, 1, 1}}).model;
  ObjectInput object;
  object.mesh = model.object->mesh;
  ExampleInput input;
  input.rest.mesh = object.mesh;
  PoseInput pose;
  pose.name = "bend";
  input.poses = {pose};
  EXPECT_EQ(doubt_of_correspondence(object, input), "");
  input.object_is_rest = false;
  EXPECT_EQ(doubt_of_correspondence(object, input), "") << "a rest example of the object's mesh";
  input.rest.mesh.vertices *= 1.1;
  EXPECT_THAT(doubt_of_correspondence(object, input), HasSubstr("bend is on the mesh of the rest example"));
  input.rest.on_object = IndexVector::LinSpaced(object.mesh.vertex_count(), 0, 1);
  EXPECT_EQ(doubt_of_correspondence(object, input), "");
  input.poses[0].same_connectivity = false;
  EXPECT_THAT(doubt_of_correspondence(object, input), HasSubstr("bend is on a mesh of its own"));
  input.poses[0].on_object = input.rest.on_object;
  EXPECT_EQ(doubt_of_correspondence(object, input), "");
}

}  // namespace
}  // namespace exmat::precompute
