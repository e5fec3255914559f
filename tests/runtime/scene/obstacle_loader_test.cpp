#include "runtime/scene/obstacle_loader.h"

#include <functional>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "common/core/error.h"

namespace exmat::runtime {
namespace {

using ::testing::HasSubstr;

SceneConfig config() {
  SceneConfig scene;
  scene.file = "scene.json";
  scene.bundle = "bar.h5";
  return scene;
}

std::string refusal(const std::function<void()>& action) {
  try {
    action();
  } catch (const InputError& error) {
    return error.what();
  }
  return "no InputError";
}

ReducedModel with_examples() {
  ReducedModel data;
  ExampleSet& set = data.examples.emplace();
  set.examples.resize(2);
  set.examples[0].name = "rest";
  set.examples[0].pose = Eigen::VectorXd::Zero(3);
  set.examples[1].name = "bend";
  set.examples[1].pose = Eigen::Vector3d(1, 2, 4);
  return data;
}

TEST(ObstacleLoader, MakesObstacles) {
  SceneConfig scene = config();
  scene.obstacles.push_back({PlaneConfig{{0, -1, 0}, {0, 1, 0}}, 2e5, 30, 0.4, {}});
  scene.obstacles.push_back({BoxConfig{{1, 0, 0}, {1, 2, 3}, Eigen::Quaterniond::Identity()},
                             1e6,
                             0,
                             0,
                             {{0, {0, 5, 0}, Eigen::Quaterniond::Identity()}}});
  scene.obstacles.push_back({SphereConfig{{0, 0, 1}, 0.5}, 1e6, 0, 0, {}});
  scene.obstacles.push_back({CapsuleConfig{{0, 0, 0}, {0, 0, 1}, 0.5}, 1e6, 0, 0, {}});
  const std::vector<Obstacle> obstacles = make_obstacles(scene);
  ASSERT_EQ(obstacles.size(), 4u);
  const Eigen::Vector3d point(0, 4, 0);
  EXPECT_EQ(obstacles[0].stiffness, 2e5);
  EXPECT_EQ(obstacles[0].damping, 30);
  EXPECT_EQ(obstacles[0].friction, 0.4);
  const double expected[] = {5, 0, std::sqrt(17) - 0.5, 3.5};
  for (std::size_t i = 0; i < 4; ++i)
    EXPECT_NEAR(PlacedObstacle(obstacles[i], 1, 0.1).signed_distance(point), expected[i], 1e-14) << i;
}

TEST(ObstacleLoader, StartsWhereTheSceneSays) {
  SceneConfig scene = config();
  const ReducedModel data = with_examples();
  EXPECT_EQ(start_coordinates(scene, data, 3), Eigen::VectorXd::Zero(3));
  scene.body.reduced = Eigen::Vector3d(3, 2, 1);
  EXPECT_EQ(start_coordinates(scene, data, 3), Eigen::Vector3d(3, 2, 1));
  EXPECT_THAT(refusal([&] { start_coordinates(scene, data, 4); }),
              HasSubstr("scene.json: /body/reduced: expected 4 numbers, as many as bar.h5 has modes, found 3"));
  scene.body.reduced.reset();
  scene.body.pose = PoseConfig{"bend", 0.5};
  EXPECT_EQ(start_coordinates(scene, data, 3), Eigen::Vector3d(0.5, 1, 2));
  scene.body.pose = PoseConfig{"twist", 1};
  EXPECT_THAT(
      refusal([&] { start_coordinates(scene, data, 3); }),
      HasSubstr("scene.json: /body/pose/example: expected an example of bar.h5; it has \"rest\", \"bend\", found "
                "\"twist\""));
  EXPECT_THAT(refusal([&] { start_coordinates(scene, ReducedModel(), 3); }), HasSubstr("it has none, found \"twist\""));
}

TEST(ObstacleLoader, RefusesWhatTheBodyCannotHave) {
  SceneConfig scene = config();
  check_body(scene, true);
  check_body(scene, false);
  scene.body.linear_velocity = Eigen::Vector3d::Zero();
  check_body(scene, false);
  EXPECT_THAT(refusal([&] { check_body(scene, true); }),
              HasSubstr("scene.json: /body/linear_velocity: expected no such member"));
  scene = config();
  scene.body.motion.emplace_back();
  check_body(scene, true);
  EXPECT_THAT(refusal([&] { check_body(scene, false); }),
              HasSubstr("scene.json: /body/motion: expected no such member"));
}

}  // namespace
}  // namespace exmat::runtime
