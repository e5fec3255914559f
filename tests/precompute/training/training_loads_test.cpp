#include "precompute/training/training_loads.h"

#include <cmath>
#include <gtest/gtest.h>

#include "common/core/error.h"

namespace exmat::precompute {
namespace {

const TrainingBody kClamped{.free = false, .size = 2, .angular_frequency = 3, .groups = {""}};
const TrainingBody kFree{.free = true, .size = 2, .angular_frequency = 3, .groups = {"", "arm"}};

SceneConfig scene_with_examples() {
  SceneConfig scene;
  scene.gravity = {0, 0, -10};
  scene.examples.emplace();
  scene.examples->stiffness = 100;
  return scene;
}

TEST(TrainingLoads, AreThoseOfTheScene) {
  SceneConfig scene = scene_with_examples();
  scene.forces = {{{3}, {1, 2, 3}}};
  scene.regions = {{"arm", {.stiffness = 7}}};
  const TrainingLoads loads = scene_loads(scene, kFree);
  ASSERT_EQ(loads.examples.size(), 2U);
  EXPECT_EQ(loads.examples[0].stiffness, 100);
  EXPECT_EQ(loads.examples[1].stiffness, 7);
  EXPECT_EQ(loads.forces.front().force, Eigen::Vector3d(1, 2, 3));
  EXPECT_FALSE(loads.obstacle);
}

// From a height of two body sizes: v^2 = 2 g h = 2 * 10 * 4.
TEST(TrainingLoads, ThrowABodyAsFastAsItFalls) {
  SceneConfig scene = scene_with_examples();
  scene.steps = 100'000;
  scene.obstacles.emplace_back();
  const TrainingLoads loads = scene_loads(scene, kFree);
  ASSERT_TRUE(loads.obstacle);
  EXPECT_NEAR((loads.velocity - Eigen::Vector3d(0, 0, -std::sqrt(80.0))).norm(), 0, 1e-12);
}

TEST(TrainingLoads, SayWhetherTheyDeformTheBody) {
  TrainingLoads loads;
  EXPECT_FALSE(loads.deforms(false));
  loads.gravity = {0, 0, -10};
  EXPECT_TRUE(loads.deforms(false));
  EXPECT_FALSE(loads.deforms(true));
  loads.examples = {{1, 0, 1}};
  EXPECT_TRUE(loads.deforms(true));
}

std::vector<std::string> names_of(const std::vector<LoadKind>& kinds) {
  std::vector<std::string> names;
  for (const LoadKind& kind : kinds) names.push_back(kind.name);
  return names;
}

TEST(TrainingLoads, AreTakenApartByKind) {
  const TrainingBody body{.free = false, .size = 1, .angular_frequency = 10, .groups = {""}};
  const TrainingLoads unknown = unknown_loads(body);
  const std::vector<LoadKind> kinds = kinds_of(unknown, false);
  ASSERT_EQ(names_of(kinds), (std::vector<std::string>{"gravity", "example forces", "forces on vertices"}));
  EXPECT_EQ(kinds[0].loads.gravity, unknown.gravity);
  EXPECT_FALSE(kinds[0].loads.patches);
  EXPECT_FALSE(runtime::acts(kinds[0].loads.examples.front()));
  EXPECT_TRUE(kinds[1].loads.gravity.isZero(0));
  EXPECT_EQ(kinds[1].loads.examples.front().stiffness, 40 * 10 * 10);  // 40 omega_1^2
  EXPECT_TRUE(kinds[2].loads.patches);
  EXPECT_EQ(kinds[2].loads.examples.size(), 1U) << "one for each of the body's";

  TrainingLoads thrown;
  thrown.gravity = {0, 0, -9};
  thrown.obstacle.emplace();
  thrown.velocity = {0, 0, -3};
  EXPECT_EQ(names_of(kinds_of(thrown, true)), std::vector<std::string>{"throws"}) << "gravity deforms no free body";
}

TEST(TrainingPlan, TakesTheSceneThenTheAssetThenWhatThereIs) {
  const SceneConfig scene = scene_with_examples();
  TrainingConfig config;
  EXPECT_FALSE(plan_training(config, &scene, {}, kClamped).general);
  EXPECT_TRUE(plan_training(config, nullptr, {}, kClamped).general);
  EXPECT_TRUE(plan_training(config, nullptr, {}, kClamped).loads.patches);
  config.loads.emplace();
  config.loads->example_stiffness = 50;
  config.loads->forces = {{IdSelection{{1}}, 2.5}};
  const TrainingPlan declared = plan_training(config, nullptr, {{1}}, kClamped);
  EXPECT_TRUE(declared.general);
  EXPECT_EQ(declared.loads.examples.front().stiffness, 50);
  EXPECT_DOUBLE_EQ(declared.loads.forces.front().force.norm(), 2.5);
  EXPECT_TRUE(declared.loads.any_direction);
  config.from = Training::kLoads;
  EXPECT_TRUE(plan_training(config, &scene, {{1}}, kClamped).general);
}

TEST(TrainingPlan, LeavesTrainingOut) {
  const SceneConfig scene = scene_with_examples();
  TrainingConfig config;
  config.from = Training::kNone;
  EXPECT_FALSE(plan_training(config, &scene, {}, kClamped).loads.deforms(false));
  config.from = Training::kAuto;
  const TrainingBody bare{.free = false, .size = 1, .angular_frequency = 1, .groups = {}};
  EXPECT_FALSE(plan_training(config, nullptr, {}, bare).loads.deforms(false));
}

TEST(TrainingPlan, OfASceneNeedsOne) {
  TrainingConfig config;
  config.from = Training::kScene;
  try {
    plan_training(config, nullptr, {}, kClamped);
    FAIL();
  } catch (const InputError& error) {
    EXPECT_EQ(error.complaint().place, "/basis/training");
    EXPECT_NE(std::string(error.what()).find("--scene"), std::string::npos);
  }
}

}  // namespace
}  // namespace exmat::precompute
