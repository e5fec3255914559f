#include "runtime/viewer/scene/scene_document.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "common/config/config.h"
#include "common/config/json_file.h"
#include "tests/support/temporary_folder.h"

namespace exmat::viewer {
namespace {

constexpr const char* kScene = R"({
  "bundle": "sub/bar.h5", "gravity": [0, 0, -1], "damping": {"mass": 2},
  "examples": {"stiffness": 300, "bias": 0.5},
  "regions": [{"name": "left", "stiffness": 0}, {"name": "right", "stiffness": 20, "weights": [0.25, 0.75]}],
  "obstacles": [{"plane": {"normal": [0, 0, 1]}}, {"sphere": {"radius": 2}, "friction": 0.1}]
})";

class Documents : public ::testing::Test {
 protected:
  test::TemporaryFolder folder_;
  SceneDocument scene_ = SceneDocument::open(folder_.write("scene.json", kScene));
};

TEST_F(Documents, SayWhatIsSet) {
  const Settings settings = scene_.settings();
  EXPECT_EQ(settings.time_step, 0.001);
  EXPECT_EQ(settings.gravity, (std::array<double, 3>{0, 0, -1}));
  EXPECT_EQ(settings.mass_damping, 2);
  ASSERT_EQ(settings.forces.size(), 3U);
  EXPECT_EQ(settings.forces[0].bias, 0.5);
  EXPECT_FALSE(settings.forces[1].on);
  EXPECT_EQ(settings.forces[2].weights, (std::vector<double>{0.25, 0.75}));
}

// The run time's own reader finds in the file what was set.
TEST_F(Documents, AreSavedAsScenesOfTheRunTime) {
  Settings settings = scene_.settings();
  settings.integrator = "newmark";
  settings.stiffness_damping = 0.25;
  settings.forces[0].stiffness = 77;
  settings.forces[2].on = false;
  settings.forces[2].given = false;
  scene_.set(settings);
  exmat_obstacle sphere = default_obstacle(), added = default_obstacle();
  sphere.shape = EXMAT_SPHERE;
  sphere.friction = 0.9;
  added.shape = EXMAT_CAPSULE;
  exmat_motion motion{};
  motion.orientation[0] = 1;
  motion.position[1] = 4;
  const std::array<PlacedObstacle, 2> placed{{{1, true, sphere, motion}, {-1, false, added, motion}}};
  std::filesystem::create_directories(folder_ / "other");
  scene_.save(folder_ / "other/saved.json", 42, placed);

  const SceneConfig saved = load_scene(folder_ / "other/saved.json");
  EXPECT_EQ(std::filesystem::weakly_canonical(saved.bundle), std::filesystem::weakly_canonical(folder_ / "sub/bar.h5"));
  EXPECT_EQ(saved.steps, 42);
  EXPECT_EQ(saved.integrator, Integrator::kNewmark);
  EXPECT_EQ(saved.stiffness_damping, 0.25);
  EXPECT_EQ(saved.mass_damping, 2);
  EXPECT_EQ(saved.examples->stiffness, 77);
  EXPECT_EQ(saved.regions[1].force.stiffness, 0);
  EXPECT_FALSE(saved.regions[1].force.weights);
  ASSERT_EQ(saved.obstacles.size(), 2U);
  EXPECT_EQ(std::get<SphereConfig>(saved.obstacles[0].shape).radius, 2);
  EXPECT_EQ(saved.obstacles[0].friction, 0.9);
  EXPECT_EQ(saved.obstacles[0].motion.at(0).position, Eigen::Vector3d(0, 4, 0));
  EXPECT_EQ(std::get<CapsuleConfig>(saved.obstacles[1].shape).end, Eigen::Vector3d(0, 0, 1));
}

TEST_F(Documents, OfSeveralBodiesAreSavedAsScenesOfTheRunTime) {
  SceneDocument scene = SceneDocument::open(folder_.write("many.json", R"({
    "bodies": [{"name": "a", "bundle": "sub/a.h5", "poses": "sub/a.txt"},
               {"name": "b", "bundle": "sub/b.h5", "gravity": [0, 0, -2], "examples": {"stiffness": 5}}],
    "gravity": [0, 0, -1]})"));
  ASSERT_EQ(scene.kinds(), 2U);
  EXPECT_EQ(scene.kind_name(1), "b");
  EXPECT_EQ(scene.bundle(1), folder_ / "sub/b.h5");
  EXPECT_EQ(scene.settings(0).gravity[2], -1);
  Settings settings = scene.settings(1);
  EXPECT_EQ(settings.gravity[2], -2);
  settings.gravity[2] = -3;
  settings.stiffness_damping = 0.5;
  settings.forces[0].stiffness = 6;
  scene.set(settings, 1);
  std::filesystem::create_directories(folder_ / "other");
  std::filesystem::create_directories(folder_ / "sub");
  folder_.write("sub/a.txt", "1 2 3\n4 5 6\n");
  scene.save(folder_ / "other/saved.json", 7, {});
  const WorldConfig saved = load_world(folder_ / "other/saved.json");
  EXPECT_EQ(saved.steps, 7);
  EXPECT_EQ(saved.bodies[0].places.size(), 2U);
  EXPECT_EQ(saved.bodies[0].scene.gravity, Eigen::Vector3d(0, 0, -1));
  EXPECT_EQ(saved.bodies[1].scene.gravity, Eigen::Vector3d(0, 0, -3));
  EXPECT_EQ(saved.bodies[1].scene.examples->stiffness, 6);
  EXPECT_EQ(saved.bodies[0].scene.stiffness_damping, 0.5);
}

TEST_F(Documents, NameTheirFilesAndSaveThemAsSeenFromElsewhere) {
  const SceneDocument scene = SceneDocument::open(folder_.write("files.json", R"({
    "bodies": [{"name": "a", "bundle": "sub/a.h5", "poses": "sub/a.txt",
                "forces": [{"vertices": {"file": "ids.txt"}, "force": [1, 0, 0]}]}],
    "attachments": [{"body": "a", "vertices": {"file": "sub/held.txt"}}],
    "obstacles": [{"mesh": {"file": "rock.ply"}}, {"plane": {"normal": [0, 0, 1]}}]})"));
  std::vector<std::filesystem::path> expected;
  for (const char* name : {"sub/a.h5", "sub/a.txt", "ids.txt", "sub/held.txt", "rock.ply"})
    expected.push_back(folder_ / name);
  EXPECT_THAT(scene.files(), ::testing::UnorderedElementsAreArray(expected));
  std::filesystem::create_directories(folder_ / "other");
  scene.save(folder_ / "other/files.json", 7, {});
  const Json saved = read_json(folder_ / "other/files.json");
  EXPECT_EQ(saved["bodies"][0]["bundle"], "../sub/a.h5");
  EXPECT_EQ(saved["bodies"][0]["forces"][0]["vertices"]["file"], "../ids.txt");
  EXPECT_EQ(saved["attachments"][0]["vertices"]["file"], "../sub/held.txt");
}

TEST(Settings, ThatNeedAnotherModelAreKnown) {
  Settings a;
  a.forces.push_back({});
  Settings b = a;
  b.gravity[1] = 3;
  b.integrator = "newmark";
  b.forces[0].stiffness = 8;
  EXPECT_TRUE(same_model(a, b));
  b.forces[0].target = "solve";
  EXPECT_FALSE(same_model(a, b));
}

}  // namespace
}  // namespace exmat::viewer
