#include "runtime/scene/obstacle_loader.h"

#include <array>
#include <fmt/format.h>
#include <functional>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "common/core/error.h"
#include "common/core/log.h"
#include "tests/support/temporary_folder.h"

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

/// A cube of 2 m about the origin, in .obj quads; without its last face where `open`, with it turned where `turned`.
std::string cube(bool open, bool turned = false, bool inward = false) {
  std::string text;
  for (int i = 0; i < 8; ++i) text += fmt::format("v {} {} {}\n", i & 1 ? 1 : -1, i & 2 ? 1 : -1, i & 4 ? 1 : -1);
  const std::array<std::array<int, 4>, 6> faces{
      {{1, 3, 4, 2}, {5, 6, 8, 7}, {1, 2, 6, 5}, {3, 7, 8, 4}, {1, 5, 7, 3}, {2, 4, 8, 6}}};
  for (std::size_t f = 0; f < (open ? 5 : 6); ++f) {
    std::array<int, 4> face = faces[f];
    if (inward || (turned && f == 5)) std::ranges::reverse(face);
    text += fmt::format("f {} {} {} {}\n", face[0], face[1], face[2], face[3]);
  }
  return text;
}

Obstacles with_mesh(const std::filesystem::path& file, double scale, double thickness) {
  SceneConfig scene = config();
  MeshConfig mesh;
  mesh.file = file;
  mesh.scale = scale;
  mesh.thickness = thickness;
  mesh.position = Eigen::Vector3d(0, 0, 5);
  mesh.orientation = Eigen::Quaterniond(Eigen::AngleAxisd(0.3, Eigen::Vector3d(1, 2, 3).normalized()));
  scene.obstacles.push_back({mesh, 1e6, 0, 0, {}});
  return make_obstacles(scene);
}

TEST(ObstacleLoader, MakesMeshes) {
  const test::TemporaryFolder folder;
  const Shape mesh = with_mesh(folder.write("a.obj", cube(false)), 0.5, 0).front()->shape;
  const Box box{{0, 0, 5},
                Eigen::Vector3d::Constant(0.5),
                Eigen::AngleAxisd(0.3, Eigen::Vector3d(1, 2, 3).normalized()).toRotationMatrix()};
  for (const Eigen::Vector3d& point : {Eigen::Vector3d(1, 2, 3), {0.1, 0.2, 5.3}, {-0.4, 0.3, 4.7}, {0, 0, 7}})
    EXPECT_NEAR(signed_distance(mesh, point), signed_distance(box, point), 1e-14);
}

TEST(ObstacleLoader, RefusesMeshesThatAreNotClosedUnlessTheyAreShells) {
  const test::TemporaryFolder folder;
  EXPECT_THAT(refusal([&] { with_mesh(folder.write("a.obj", cube(true)), 1, 0); }),
              ::testing::AllOf(HasSubstr("a.obj: expected a closed mesh"), HasSubstr("4 edges of one triangle alone"),
                               HasSubstr("\"thickness\"")));
  EXPECT_THAT(refusal([&] { with_mesh(folder.write("b.obj", cube(false, true)), 1, 0); }),
              HasSubstr("4 edges whose two triangles look opposite ways"));
  const Shape shell = with_mesh(folder.path("a.obj"), 1, 0.2).front()->shape;
  EXPECT_NEAR(signed_distance(shell, Eigen::Vector3d(0, 0, 5)), 0.9, 1e-14);
  EXPECT_THAT(refusal([&] { with_mesh(folder.path("none.obj"), 1, 0); }), HasSubstr("none.obj"));
  EXPECT_THAT(refusal([&] { with_mesh(folder.path("a.glb"), 1, 0); }), HasSubstr(".obj, .ply or .stl"));
  EXPECT_THAT(refusal([&] { with_mesh(folder.write("flat.obj", "v 0 0 0\nv 0 0 0\nv 1 0 0\nf 1 2 3\n"), 1, 1); }),
              HasSubstr("triangles with corners at three places, found none"));
}

TEST(ObstacleLoader, WarnsOfFacesThatLookInwardOrCrossThemselves) {
  const test::TemporaryFolder folder;
  std::string warned;
  const log::Sink former = log::set_sink([&](log::Level, std::string_view message) { warned += message; });
  const Shape room = with_mesh(folder.write("room.obj", cube(false, false, true)), 1, 0).front()->shape;
  with_mesh(folder.write("bow.obj", "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 3 2 4\n"), 1, 0.1);
  log::set_sink(former);
  EXPECT_THAT(warned, HasSubstr("room.obj: its faces look inward"));
  EXPECT_THAT(warned, HasSubstr("bow.obj: 1 face whose edges cross is cut"));
  EXPECT_NEAR(signed_distance(room, Eigen::Vector3d(0, 0, 5)), 1, 1e-14);
}

TEST(ObstacleLoader, MakesHeightFieldsOfAFileOrOfTheScene) {
  const test::TemporaryFolder folder;
  SceneConfig scene = config();
  HeightFieldConfig field;
  field.spacing = Eigen::Vector2d(2, 1);
  field.position = Eigen::Vector3d(0, 0, 1);
  field.heights = (Eigen::MatrixXd(2, 2) << 1, 1, 1, 1).finished();
  scene.obstacles.push_back({field, 1e6, 0, 0, {}});
  field.file = folder.write("a.csv", "1,1,1\n1,1,1\n");
  scene.obstacles.push_back({field, 1e6, 0, 0, {}});
  const Obstacles obstacles = make_obstacles(scene);
  EXPECT_NEAR(signed_distance(obstacles[0]->shape, Eigen::Vector3d(1, 0.5, 5)), 3, 1e-15);
  EXPECT_NEAR(signed_distance(obstacles[0]->shape, Eigen::Vector3d(5, 0.5, 2)), 3, 1e-15);
  EXPECT_NEAR(signed_distance(obstacles[1]->shape, Eigen::Vector3d(3, 0.5, 1.5)), -0.5, 1e-15);
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
  const Obstacles obstacles = make_obstacles(scene);
  ASSERT_EQ(obstacles.size(), 4u);
  const Eigen::Vector3d point(0, 4, 0);
  EXPECT_EQ(obstacles[0]->stiffness, 2e5);
  EXPECT_EQ(obstacles[0]->damping, 30);
  EXPECT_EQ(obstacles[0]->friction, 0.4);
  const double expected[] = {5, 0, std::sqrt(17) - 0.5, 3.5};
  for (std::size_t i = 0; i < 4; ++i)
    EXPECT_NEAR(PlacedObstacle(*obstacles[i], 1, 0.1).signed_distance(point), expected[i], 1e-14) << i;
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
