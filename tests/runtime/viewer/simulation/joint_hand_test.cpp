#include "runtime/viewer/simulation/joint_hand.h"

#include <Eigen/Geometry>
#include <gtest/gtest.h>
#include <numbers>
#include <vector>

#include "common/bundle/bundle.h"
#include "runtime/viewer/script/script.h"
#include "tests/support/synthetic_model.h"
#include "tests/support/temporary_folder.h"

// Hands on joints of a bar of 1 m on three bones along x, which begin at 0 m, 0.5 m and 1 m.
namespace exmat::viewer {
namespace joint_hand_test {

using Transform = Eigen::Matrix<double, 3, 4, Eigen::RowMajor>;

constexpr double kMiddle = 0.125;  // of the bar's section [m]

Eigen::Vector3d place(double x, double z = kMiddle) { return {x, kMiddle, z}; }

// Bones of the same axes as the world; both ends are held, and an animation shifts all by 0.2 m in z.
void put_on_bones(ReducedModel& model) {
  SkeletonData data;
  data.bones = {"root", "middle", "tip"};
  data.parents = IndexVector(Eigen::Vector3i(-1, 0, 1));
  data.bind.setZero(9, 4);
  data.animations = {"lift"};
  data.first_frames = IndexVector(Eigen::Vector2i(0, 2));
  data.times = Eigen::Vector2d(0, 1);
  data.poses.setZero(6, 7);
  for (int b = 0; b < 3; ++b) {
    data.bind.middleRows(3 * b, 3) << Eigen::Matrix3d::Identity(), place(0.5 * b);
    for (int frame = 0; frame < 2; ++frame)
      data.poses.row(3 * frame + b) << 0.5 * b, kMiddle, kMiddle + 0.2 * frame, 1, 0, 0, 0;
  }
  const VertexArray& rest = model.object->mesh.vertices;
  data.weights.setZero(rest.rows(), 3);
  for (Eigen::Index v = 0; v < rest.rows(); ++v) {
    data.weights(v, rest(v, 0) < 0.5 ? 0 : 1) = 1;
    if (rest(v, 0) < 1 - 1e-9) continue;
    model.object->fixed[v] = 1;
    model.modal->basis.middleRows<3>(3 * v).setZero();
  }
  model.skeleton = data;
}

class JointHands : public ::testing::Test {
 protected:
  JointHands() {
    test::Bar bar = test::make_bar();
    put_on_bones(bar.model);
    write_bundle(bar.model, folder_ / "bar.h5");
  }
  Simulation make(const std::string& body = "{}") {
    return {{SceneDocument::open(folder_.write("scene.json", R"({"bundle": "bar.h5", "body": )" + body + "}"))},
            EXMAT_SURFACE_AUTO};
  }
  static Eigen::Vector3d joint(Simulation& simulation, std::size_t bone) {
    return simulation.snapshot({}).bodies[0].joint(bone);
  }
  // Farthest of the points whose rest is at x = 1 from where a motion takes them [m].
  static double off_end(Simulation& simulation, const Eigen::Isometry3d& motion) {
    const std::vector<double>& rest = simulation.shape(0)->rest;
    const std::vector<float> now = simulation.positions(0);
    double farthest = 0;
    for (std::size_t i = 0; i < rest.size(); i += 3) {
      if (rest[i] < 1 - 1e-9) continue;
      const Eigen::Vector3d expected = motion * Eigen::Vector3d(rest[i], rest[i + 1], rest[i + 2]);
      farthest = std::max(farthest, (Eigen::Vector3d(now[i], now[i + 1], now[i + 2]) - expected).norm());
    }
    return farthest;
  }

  test::TemporaryFolder folder_;
};

// A quarter turn about y takes x to -z.
TEST(TurnToward, TurnsTheParentAndAllThatHangsOnIt) {
  const std::vector<std::int64_t> parents{-1, 0, 1, 0, 2};
  const std::vector<Eigen::Vector3d> joints{{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {0, 3, 0}, {2, 1, 0}};
  std::vector<double> transforms(12 * joints.size());
  const auto bone = [&](std::size_t b) { return Eigen::Map<Transform>(transforms.data() + 12 * b); };
  for (std::size_t b = 0; b < joints.size(); ++b) bone(b) << Eigen::Matrix3d::Identity(), joints[b];
  turn_toward(2, {1, 0, -7}, 1, parents, transforms);
  const Eigen::Matrix3d turn = (Eigen::Matrix3d() << 0, 0, 1, 0, 1, 0, -1, 0, 0).finished();
  const std::vector<Eigen::Vector3d> expected{{0, 0, 0}, {1, 0, 0}, {1, 0, -1}, {0, 3, 0}, {1, 1, -1}};
  for (std::size_t b = 0; b < joints.size(); ++b) {
    EXPECT_LE((bone(b).col(3) - expected[b]).norm(), 1e-12) << b;
    const Eigen::Matrix3d axes = b == 0 || b == 3 ? Eigen::Matrix3d(Eigen::Matrix3d::Identity()) : turn;
    EXPECT_LE((bone(b).leftCols<3>() - axes).norm(), 1e-12) << b;
  }
  turn_toward(2, {1, 0, 0}, 1, parents, transforms);  // where the parent is: no way to turn
  EXPECT_LE((bone(2).col(3) - expected[2]).norm(), 1e-12);
  turn_toward(0, {0, 0, 4}, 0.25, parents, transforms);
  for (std::size_t b = 0; b < joints.size(); ++b)
    EXPECT_LE((bone(b).col(3) - expected[b] - Eigen::Vector3d::UnitZ()).norm(), 1e-12) << b;
}

TEST_F(JointHands, TurnABodyAndLeaveItThere) {
  Simulation simulation = make();
  const int hand = simulation.grab_joint(0, 2);
  simulation.move_grip(hand, place(0.5, kMiddle - 3));
  simulation.advance(2000);
  const Eigen::Isometry3d motion = Eigen::Translation3d(place(0.5)) *
                                   Eigen::AngleAxisd(std::numbers::pi / 2, Eigen::Vector3d::UnitY()) *
                                   Eigen::Translation3d(-place(0.5));
  EXPECT_LE((joint(simulation, 0) - place(0)).norm(), 1e-12);
  EXPECT_LE((joint(simulation, 1) - place(0.5)).norm(), 1e-12);
  EXPECT_LE((joint(simulation, 2) - place(0.5, kMiddle - 0.5)).norm(), 1e-9);
  EXPECT_LE(off_end(simulation, motion), 1e-6);  // positions are floats
  simulation.release(hand);
  simulation.advance(50);
  EXPECT_LE((joint(simulation, 2) - place(0.5, kMiddle - 0.5)).norm(), 1e-9);
}

TEST_F(JointHands, ShiftARoot) {
  Simulation simulation = make();
  simulation.move_grip(simulation.grab_joint(0, 0), place(0.3));
  simulation.advance(2000);
  for (std::size_t bone = 0; bone < 3; ++bone)
    EXPECT_LE((joint(simulation, bone) - place(0.5 * static_cast<double>(bone) + 0.3)).norm(), 1e-9) << bone;
}

TEST_F(JointHands, StopAnAnimationUntilAReset) {
  const std::string body = R"({"animation": {"name": "lift", "loop": false}})";
  Simulation simulation = make(body), alone = make(body);
  simulation.advance(100);
  const Eigen::Vector3d held = joint(simulation, 0);
  EXPECT_GT(held.z(), kMiddle);
  simulation.release(simulation.grab_joint(0, 2));
  simulation.advance(100);
  EXPECT_LE((joint(simulation, 0) - held).norm(), 1e-12);
  simulation.reset();
  EXPECT_EQ(simulation.steps(), 0);
  simulation.advance(100);
  alone.advance(100);
  EXPECT_EQ(simulation.hash(), alone.hash());
}

TEST_F(JointHands, AreThoseOfTheMouseWhereBonesAreShown) {
  Simulation simulation = make();
  Studio studio(simulation);
  const PictureSize picture{800, 600};
  studio.camera().look(place(0.5) - Eigen::Vector3d(0, 4, 0), place(0.5));
  const Eigen::Vector2d at = *studio.camera().pixel(place(1), picture) - Eigen::Vector2d(3, 0);
  ASSERT_TRUE(studio.pick(at, picture));
  EXPECT_EQ(studio.pick(at, picture)->what, Pick::What::kBody);
  studio.look().bones = true;
  EXPECT_EQ(studio.pick(at, picture)->what, Pick::What::kJoint);
  EXPECT_EQ(studio.pick(at, picture)->joint, 2U);
  ASSERT_TRUE(studio.begin_drag(at, picture));
  studio.drag(*studio.camera().pixel(place(0.5, kMiddle + 0.5), picture), picture);
  studio.runner().with([](Simulation& now) { now.advance(2000); });
  EXPECT_LE((joint(simulation, 2) - place(0.5, kMiddle + 0.5)).norm(), 1e-9);
  studio.end_drag();
  EXPECT_TRUE(simulation.snapshot({}).grips.empty());
}

TEST_F(JointHands, AreNamedByScripts) {
  Simulation simulation = make();
  Studio studio(simulation);
  const auto player = [&](const std::string& actions) {
    return ScriptPlayer(load_script(folder_.write("script.json", R"({"actions": )" + actions + "}")), studio);
  };
  ScriptPlayer script = player(R"([{"time": 0, "show": {"bones": true}, "grab": {"hand": "a", "joint": "tip"}},
    {"time": 1, "move": {"hand": "a", "by": [-0.5, 0, 0.5], "duration": 1}}, {"time": 9, "release": "a"}])");
  script.play(5);
  EXPECT_TRUE(studio.look().bones);
  const GripSnapshot hand = simulation.snapshot({}).grips.at(0);
  EXPECT_LE((hand.point - place(1)).norm(), 1e-12);
  EXPECT_LE((hand.target - place(0.5, kMiddle + 0.5)).norm(), 1e-12);
  studio.runner().with([](Simulation& now) { now.advance(2000); });
  EXPECT_LE((joint(simulation, 2) - place(0.5, kMiddle + 0.5)).norm(), 1e-9);
  script.play(9);
  EXPECT_TRUE(simulation.snapshot({}).grips.empty());
  const auto fault = [&](const std::string& actions) {
    try {
      player(actions);
    } catch (const std::exception& error) {
      return std::string(error.what());
    }
    return std::string("none");
  };
  EXPECT_NE(fault(R"([{"time": 0, "grab": {"hand": "a", "joint": "tp"}}])")
                .find("/actions/0/grab/joint: expected a joint: root, middle, tip, found \"tp\""),
            std::string::npos);
  EXPECT_NE(fault(R"([{"time": 0, "grab": {"hand": "a"}}])")
                .find("/actions/0/grab: expected exactly one of \"joint\" and \"point\""),
            std::string::npos);
}

}  // namespace joint_hand_test
}  // namespace exmat::viewer
