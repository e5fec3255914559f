#include <fstream>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "common/config/config.h"
#include "common/config/pose_file.h"
#include "common/core/error.h"
#include "tests/support/temporary_folder.h"

namespace exmat {
namespace {

using ::testing::HasSubstr;

class WorldConfigTest : public ::testing::Test {
 protected:
  std::filesystem::path write(const std::string& name, const std::string& text) const {
    const std::filesystem::path file = folder_.path() / name;
    std::ofstream(file) << text;
    return file;
  }
  /// A reader's message on a file that it refuses; empty where it does not.
  template <class Read>
  std::string refusal_of(const Read& read, const std::string& name, const std::string& text) const {
    try {
      read(write(name, text));
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  }
  std::string failure_of(const std::string& text) const { return refusal_of(load_world, "a.json", text); }
  std::string refused_poses(const std::string& text) const { return refusal_of(read_poses, "p.txt", text); }

  test::TemporaryFolder folder_;
};

TEST_F(WorldConfigTest, BodiesShareWhatIsNotTheirOwn) {
  const auto world = load_world(write("w.json", R"({"time_step": 0.002, "steps": 7, "gravity": [0, 0, -1],
    "contact": {"stiffness": 3e6, "damping": 20, "friction": 0.4},
    "obstacles": [{"plane": {"normal": [0, 0, 1]}}], "output": {"trajectory": "w.h5", "every": 3},
    "bodies": [{"name": "a", "bundle": "a.h5", "grid": {"counts": [2, 1, 3], "spacing": [1, 2, 4]}},
               {"name": "b", "bundle": "b.h5", "body": {"linear_velocity": [1, 0, 0]}}]})"));
  EXPECT_TRUE(world.is_list);
  EXPECT_EQ(world.time_step, 0.002);
  EXPECT_EQ(world.steps, 7);
  EXPECT_EQ(world.every, 3);
  EXPECT_EQ(*world.trajectory, folder_.path() / "w.h5");
  EXPECT_EQ(world.contact.stiffness, 3e6);
  EXPECT_EQ(world.contact.damping, 20);
  EXPECT_EQ(world.contact.friction, 0.4);
  ASSERT_EQ(world.bodies.size(), 2u);
  ASSERT_EQ(world.bodies[0].places.size(), 6u);
  EXPECT_EQ(world.bodies[0].places[5].position, Eigen::Vector3d(1, 0, 8));
  ASSERT_EQ(world.bodies[1].places.size(), 1u);
  for (const BodiesConfig& bodies : world.bodies) {
    EXPECT_EQ(bodies.scene.gravity, Eigen::Vector3d(0, 0, -1));
    EXPECT_EQ(bodies.scene.obstacles.size(), 1u);
    EXPECT_EQ(bodies.scene.time_step, 0.002);
    EXPECT_TRUE(needs_of(bodies.scene).contact);
  }
  EXPECT_EQ(world.bodies[1].scene.bundle, folder_.path() / "b.h5");
  EXPECT_EQ(*world.bodies[1].scene.body.linear_velocity, Eigen::Vector3d(1, 0, 0));
}

TEST_F(WorldConfigTest, ABodyMayHaveItsOwnGravityAndKeys) {
  const auto world = load_world(write("w.json", R"({"gravity": {"keys": [{"time": 2, "value": [0, 0, -1]}]},
    "bodies": [{"name": "a", "bundle": "a.h5"}, {"name": "b", "bundle": "b.h5", "gravity": [1, 0, 0],
      "examples": {"stiffness": {"keys": [{"time": 0, "value": 7}]}}}]})"));
  EXPECT_EQ(world.bodies[0].scene.gravity_keys.times.size(), 1u);
  EXPECT_EQ(world.bodies[1].scene.gravity, Eigen::Vector3d(1, 0, 0));
  EXPECT_TRUE(world.bodies[1].scene.gravity_keys.empty());
  EXPECT_EQ(place_of_keys(world.bodies[1].scene), "/bodies/1/examples");
  EXPECT_THAT(failure_of(R"({"bodies": [{"name": "a", "bundle": "a.h5", "gravity": {"keys": [
      {"time": 1, "value": [0, 0, 0]}, {"time": 0, "value": [0, 0, 0]}]}}]})"),
              HasSubstr("/bodies/0/gravity/keys/1/time"));
}

TEST_F(WorldConfigTest, ASingleBundleIsAShortSpelling) {
  const auto world = load_world(write("s.json", R"({"bundle": "a.h5", "instances": 3, "steps": 5})"));
  EXPECT_FALSE(world.is_list);
  EXPECT_EQ(world.steps, 5);
  ASSERT_EQ(world.bodies.size(), 1u);
  EXPECT_EQ(world.bodies[0].name, "");
  EXPECT_EQ(world.bodies[0].places.size(), 3u);
  EXPECT_FALSE(world.bodies[0].scene.meets_bodies);
}

TEST_F(WorldConfigTest, GroupsAndMasksSayWhoMeetsWhom) {
  const auto meets = [&](const std::string& bodies, const std::string& more = "") {
    std::vector<bool> found;
    for (const BodiesConfig& kind : load_world(write("w.json", R"({"bodies": [)" + bodies + "]" + more + "}")).bodies)
      found.push_back(kind.scene.meets_bodies);
    return found;
  };
  const std::string a = R"({"name": "a", "bundle": "a.h5")", b = R"({"name": "b", "bundle": "b.h5")";
  EXPECT_EQ(meets(a + "}"), std::vector<bool>{false}) << "there is no other";
  EXPECT_EQ(meets(a + R"(, "grid": {"counts": [2, 1, 1], "spacing": [1, 0, 0]}})"), std::vector<bool>{true});
  EXPECT_EQ(meets(a + "}", R"(, "contact": {"self": true})"), std::vector<bool>{true});
  EXPECT_EQ(meets(a + "}, " + b + "}"), (std::vector<bool>{true, true}));
  EXPECT_EQ(meets(a + R"(, "mask": 0}, )" + b + "}"), (std::vector<bool>{false, false}));
  EXPECT_EQ(meets(a + R"(, "group": 2, "mask": 4}, )" + b + R"(, "group": 4, "mask": 2})"),
            (std::vector<bool>{true, true}));
  const auto world = load_world(write("w.json", R"({"bodies": [)" + a + R"(, "group": 6}], "obstacles": [
    {"plane": {"normal": [0, 0, 1]}, "group": 8, "mask": 2}, {"plane": {"normal": [0, 0, 1]}, "mask": 1}]})"));
  EXPECT_EQ(world.bodies[0].scene.meeting.group, 6u);
  const std::vector<ObstacleConfig>& obstacles = world.bodies[0].scene.obstacles;
  EXPECT_TRUE(world.bodies[0].scene.meeting.meets(obstacles[0].meeting));
  EXPECT_FALSE(world.bodies[0].scene.meeting.meets(obstacles[1].meeting));
  EXPECT_THAT(failure_of(R"({"bodies": [)" + a + R"(, "group": 0}]})"), HasSubstr("/bodies/0/group"));
  EXPECT_THAT(failure_of(R"({"bodies": [)" + a + R"(, "mask": -1}]})"), HasSubstr("/bodies/0/mask"));
}

TEST_F(WorldConfigTest, MistakesAreNamed) {
  const std::string body = R"({"name": "a", "bundle": "a.h5"})";
  EXPECT_THAT(failure_of(R"({"bundle": "a.h5", "bodies": [)" + body + "]}"), HasSubstr("found both"));
  EXPECT_THAT(failure_of(R"({"bodies": [)" + body + "," + body + "]}"), HasSubstr("/bodies/1/name"));
  EXPECT_THAT(failure_of(R"({"bodies": [)" + body + R"(], "forces": []})"), HasSubstr("/forces"));
  EXPECT_THAT(failure_of(R"({"bodies": [)" + body + R"(], "instances": 3})"), HasSubstr("grid"));
  EXPECT_THAT(failure_of(R"({"bodies": [{"name": "a/b", "bundle": "a.h5"}]})"), HasSubstr("/bodies/0/name"));
  EXPECT_THAT(failure_of(R"({"bodies": [{"name": "a", "bundle": "a.h5", "colour": 1}]})"),
              HasSubstr("/bodies/0/colour"));
  EXPECT_THAT(failure_of(R"({"bodies": [{"name": "a", "bundle": "a.h5", "poses": "p.txt",
                            "grid": {"counts": [1, 1, 1], "spacing": [1, 1, 1]}}]})"),
              HasSubstr("grid or poses"));
  EXPECT_THAT(failure_of(R"({"bodies": [{"name": "a", "bundle": "a.h5", "body": {"orientation": [2, 0, 0, 0]}}]})"),
              HasSubstr("/bodies/0/body/orientation"));
  write("one.json", R"({"bodies": [)" + body + "]}");
  EXPECT_THAT(refusal_of(load_scene, "one.json", R"({"bodies": [)" + body + "]}"),
              HasSubstr("takes one of the bodies as a scene of its own"));
}

TEST_F(WorldConfigTest, BodiesAreAtMostAsManyAsAListMayHave) {
  const auto grid = [](const char* counts) {
    return std::string(R"({"name": "a", "bundle": "a.h5", "grid": {"spacing": [1, 1, 1], "counts": )") + counts + "}}";
  };
  const std::string one = R"(, {"name": "b", "bundle": "a.h5")";
  write("p.txt", "0 0 1\n0 0 2\n");
  EXPECT_EQ(failure_of(R"({"bodies": [)" + grid("[1000, 100, 1]") + "]}"), "");
  EXPECT_THAT(failure_of(R"({"bodies": [)" + grid("[10000, 10000, 10000]") + "]}"),
              HasSubstr("/bodies/0/grid/counts: expected at most 100000 bodies in a scene, found 1000000000000"));
  EXPECT_THAT(failure_of(R"({"bodies": [)" + grid("[1000, 100, 1]") + one + "}]}"),
              HasSubstr("/bodies/1: expected at most 100000 bodies in a scene, found 100001"));
  EXPECT_THAT(failure_of(R"({"bodies": [)" + grid("[1000, 100, 1]") + one + R"(, "poses": "p.txt"}]})"),
              HasSubstr("/bodies/1/poses: expected at most 100000 bodies in a scene, found 100002"));
}

TEST_F(WorldConfigTest, PosesAreLines) {
  const auto places = read_poses(write("p.txt", "# where\n\n1 2 3\r\n  0.5 0 -1 0 0.6 0 0.8  \n4 5 6"));
  ASSERT_EQ(places.size(), 3u);
  EXPECT_EQ(places[0].position, Eigen::Vector3d(1, 2, 3));
  EXPECT_EQ(places[1].orientation.coeffs(), Eigen::Vector4d(0.6, 0, 0.8, 0));
  EXPECT_EQ(places[2].position, Eigen::Vector3d(4, 5, 6));
}

TEST_F(WorldConfigTest, BadPosesAreRefusedWithTheirLine) {
  EXPECT_THAT(refused_poses("1 2 3\n1 2\n"), HasSubstr("line 2"));
  EXPECT_THAT(refused_poses("1 2 three\n"), HasSubstr("line 1"));
  for (const char* const line : {"1 2 nan\n", "1 2 -1e31\n"})
    EXPECT_THAT(refused_poses(line), HasSubstr("finite numbers of at most 1e+30"));
  EXPECT_THAT(refused_poses("1 2 3 1 1 0 0\n"), HasSubstr("length 1"));
  EXPECT_THAT(refused_poses("# nothing\n"), HasSubstr("a line for each body"));
}

}  // namespace
}  // namespace exmat
