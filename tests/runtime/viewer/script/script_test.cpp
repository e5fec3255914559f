#include "runtime/viewer/script/script.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "common/bundle/bundle.h"
#include "common/core/error.h"
#include "tests/support/synthetic_model.h"
#include "tests/support/temporary_folder.h"

namespace exmat::viewer {
namespace {

using ::testing::HasSubstr;

class Scripts : public ::testing::Test {
 protected:
  Scripts() {
    write_bundle(test::make_bar({.examples = 2}).model, folder_ / "bar.h5");
    simulation_.emplace(std::vector{SceneDocument::open(
                            folder_.write("scene.json", R"({"bundle": "bar.h5", "examples": {"stiffness": 10}})"))},
                        EXMAT_SURFACE_AUTO);
    studio_.emplace(*simulation_);
  }
  ScriptPlayer player(const std::string& actions) {
    return {load_script(folder_.write("script.json", R"({"actions": )" + actions + "}")), *studio_};
  }
  std::string fault(const std::string& actions) {
    try {
      player(actions).play(100);
    } catch (const InputError& error) {
      return error.what();
    }
    return "none";
  }

  test::TemporaryFolder folder_;
  std::optional<Simulation> simulation_;
  std::optional<Studio> studio_;
};

TEST_F(Scripts, DragAPointAlongItsWay) {
  ScriptPlayer script = player(R"([{"time": 0, "grab": {"hand": "a", "point": [1, 0, 0]}},
    {"time": 1, "move": {"hand": "a", "by": [0, 0, 2], "duration": 4}}, {"time": 9, "release": "a"}])");
  const auto height = [&] {
    return studio_->runner().with([](Simulation& s) { return s.snapshot({}); }).grips.at(0).target.z();
  };
  script.play(0);
  const double from = height();
  script.play(3);
  EXPECT_NEAR(height(), from + 1, 1e-12);
  script.play(8);
  EXPECT_NEAR(height(), from + 2, 1e-12);
  script.play(9);
  EXPECT_TRUE(simulation_->snapshot({}).grips.empty());
}

TEST_F(Scripts, PinAndLetGo) {
  ScriptPlayer script =
      player(R"([{"time": 0, "pin": {"point": [1, 0, 0]}}, {"time": 1, "pin": {"point": [1, 0, 0], "body": 0}}])");
  script.play(0);
  EXPECT_EQ(simulation_->snapshot({}).pins.size(), 1U);
  script.play(1);
  EXPECT_TRUE(simulation_->snapshot({}).pins.empty());
  EXPECT_THAT(fault(R"([{"time": 0, "pin": {"point": [0, 0, 0], "body": 3}}])"),
              HasSubstr("/actions/0/pin/body: expected a body, 0 to 0"));
}

TEST_F(Scripts, SetAndShow) {
  player(R"([{"time": 0, "set": {"gravity": [0, 1, 0], "stiffness": 70, "weights": [0.5, 0.5], "speed": 0.5},
    "show": {"wireframe": true, "colour": "strain_energy"}, "camera": {"position": [0, -5, 0], "target": [0, 0, 0]}}])")
      .play(0);
  EXPECT_EQ(studio_->settings(0).gravity[1], 1);
  EXPECT_EQ(studio_->settings(0).forces[0].stiffness, 70);
  EXPECT_TRUE(studio_->settings(0).forces[0].given);
  EXPECT_EQ(studio_->runner().speed(), 0.5);
  EXPECT_TRUE(studio_->look().wireframe);
  EXPECT_EQ(studio_->look().colouring, Colouring::kStrainEnergy);
  EXPECT_LE((studio_->camera().position() - Eigen::Vector3d(0, -5, 0)).norm(), 1e-9);
}

TEST_F(Scripts, SayWhatIsWrongWithThem) {
  EXPECT_THAT(fault(R"([{"time": 1}, {"time": 0}])"), HasSubstr("/actions/1/time: expected a number >= 1"));
  EXPECT_THAT(fault(R"([{"time": 0, "release": "a"}])"), HasSubstr("/actions/0/release: expected a hand"));
  EXPECT_THAT(fault(R"([{"time": 0, "grab": {"hand": "a", "point": [0, 0, 0], "body": 3}}])"),
              HasSubstr("/actions/0/grab/body: expected a body, 0 to 0"));
  EXPECT_THAT(fault(R"([{"time": 0, "throw": {"velocity": [1, 0, 0]}}])"), HasSubstr("a free body"));
  EXPECT_THAT(fault(R"([{"time": 0, "move_obstacle": {"obstacle": 0, "by": [1, 0, 0]}}])"),
              HasSubstr("one of 0 obstacles"));
  EXPECT_THAT(fault(R"([{"time": 0, "set": {"region": "left", "bias": 0}}])"), HasSubstr("left"));
  EXPECT_THAT(fault(R"([{"time": 0, "set": {"weights": [0.5, 0.6]}}])"), HasSubstr("1.1"));
  EXPECT_THAT(fault(R"([{"time": 0, "set": {"internal_force": "polynomial"}}])"), HasSubstr("polynomial"));
  EXPECT_THAT(fault(R"([{"time": 0, "grap": {}}])"), HasSubstr("grab"));
}

}  // namespace
}  // namespace exmat::viewer
