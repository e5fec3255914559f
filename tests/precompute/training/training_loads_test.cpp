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

TEST(TrainingLoads, AreNamedAsTriedOrNot) {
  const TrainingBody body{.free = false, .size = 1, .angular_frequency = 10, .groups = {""}};
  const TrainingLoads unknown = unknown_loads(body);
  // kappa: 40 omega_1^2 times exp(-2) to exp(2).
  EXPECT_EQ(tried_text(unknown, false),
            "gravity of 9.81 m/s^2 in any direction, example forces of kappa 5.4e+02 to 3e+04 1/s^2 and bias 0.5 to 1, "
            "pushes on patches of the surface");
  EXPECT_EQ(untried_text(unknown, false), "contact, stronger or weaker ones");
  EXPECT_EQ(untried_text({}, false), "gravity, example forces, forces on vertices, contact, stronger or weaker ones");
  TrainingLoads thrown;
  thrown.obstacle.emplace();
  thrown.velocity = {0, 0, -3};
  EXPECT_EQ(tried_text(thrown, true), "throws at a plane with 3 m/s");
  EXPECT_EQ(untried_text(thrown, true), "example forces, forces on vertices, stronger or weaker ones");
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
