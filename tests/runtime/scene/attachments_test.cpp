#include <cmath>
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "common/bundle/bundle.h"
#include "common/core/error.h"
#include "common/hdf5/hdf5_file.h"
#include "runtime/sim/step/contact_step.h"
#include "tests/support/scene_run.h"
#include "tests/support/synthetic_model.h"
#include "tests/support/temporary_folder.h"

// Attachments of scenes: to the world, along keys and to obstacles, in modes and in all vertices.
namespace exmat::runtime {
namespace {

using ::testing::HasSubstr;

constexpr const char* kEnd = R"("vertices": {"box": {"min": [0.99, -1, -1], "max": [1.01, 1, 1]}})";
constexpr const char* kTurn =
    R"("motion": [{"time": 0, "position": [0.5, 0, 0]},
                  {"time": 0.2, "position": [0.5, 0.1, 0.05], "orientation": [0.96, 0, 0.28, 0]}])";

class SceneAttachments : public ::testing::Test {
 protected:
  void SetUp() override {
    bar_ = test::make_bar({.free = true});
    bar_.model.contact = test::surface_contact(bar_.model);
    write_bundle(bar_.model, folder_ / "bar.h5");
    const VertexArray& rest = bar_.model.object->mesh.vertices;
    for (Eigen::Index i = 0; i < rest.rows(); ++i)
      if (rest(i, 0) > 0.99) end_.push_back(i);
  }
  std::string text(const std::string& attachments, const std::string& more = "") const {
    return R"({"bundle": "bar.h5", "time_step": 0.004, "steps": 60, "gravity": [0, 0, -9.81], "attachments": [)" +
           attachments + "]" + more + "}";
  }
  SceneConfig scene(const std::string& attachments, const std::string& more = "") const {
    test::write_file(folder_ / "scene.json", text(attachments, more));
    return load_scene(folder_ / "scene.json");
  }
  /// World positions of the end's vertices [3 x k].
  Eigen::Matrix3Xd end_of(const LoadedScene& kind, const State& state) const {
    Eigen::Matrix3Xd positions(3, std::ssize(end_));
    const Placement at = kind.model->frame->placement(state.frame);
    for (Eigen::Index k = 0; k < positions.cols(); ++k) {
      const Eigen::Index vertex = end_[static_cast<std::size_t>(k)];
      const Eigen::Vector3d rest = bar_.model.object->mesh.vertices.row(vertex);
      positions.col(k) = state.full ? Eigen::Vector3d(rest + full_displacement(*kind.full, at, *state.full, vertex))
                                    : at.to_world(rest + bar_.basis().middleRows<3>(3 * vertex) * state.q);
    }
    return positions;
  }
  std::string refusal(const std::string& attachments, const std::string& more = "") const {
    try {
      const test::LoadedRun loaded(scene(attachments, more));
      loaded.bodies();
    } catch (const InputError& error) {
      return error.what();
    }
    return "none";
  }

  test::TemporaryFolder folder_;
  test::Bar bar_;
  std::vector<Eigen::Index> end_;
};

// Where the motion of the frame takes the places of the start, by definition: in all vertices those of the end, in the
// modes one vertex.
TEST_F(SceneAttachments, GoExactlyWhereTheirFrameGoes) {
  const std::string obstacle = std::string(R"(, "obstacles": [{"sphere": {"center": [0, 9, 0], "radius": 0.1}, )") +
                               kTurn + R"(}, {"plane": {"normal": [0, 0, 1], "point": [0, 0, -99]}}])";
  const RigidMotion motion({{0, {0.5, 0, 0}}, {0.2, {0.5, 0.1, 0.05}, {0.96, 0, 0.28, 0}}});
  for (const char* space : {"reduced", "full"})
    for (const std::string& to : {std::string(R"("to": {"obstacle": 0})"), std::string(kTurn)}) {
      const std::string vertices = std::string(space) == "full"
                                       ? kEnd
                                       : R"("kind": "ball", "vertices": {"ids": [)" + std::to_string(end_[0]) + "]}";
      const test::LoadedRun loaded(
          scene("{" + vertices + ", " + to + "}", obstacle + R"(, "space": ")" + space + R"(")"));
      Bodies bodies = loaded.bodies();
      const Eigen::Matrix3Xd start = end_of(loaded.kind(), bodies.world().state(0));
      const MotionSample from = motion.sample(0);
      for (int i = 1; i <= 60; ++i) {
        bodies.step();
        const MotionSample at = motion.sample(i * 0.004);
        const Eigen::Matrix3Xd now = end_of(loaded.kind(), bodies.world().state(0));
        for (Eigen::Index k = 0; k < (std::string(space) == "full" ? now.cols() : 1); ++k)
          EXPECT_LE((now.col(k) - at.to_world(from.to_frame(start.col(k)))).norm(), 1e-10) << space << to << i;
      }
    }
}

// Backward Euler's change of the momentum is the weight less the load of what holds the body, in each step.
TEST_F(SceneAttachments, BearWhatTheTrajectorySays) {
  for (const std::string kind : {"fixed", "spring"}) {
    test::run(scene("{" + std::string(kEnd) + R"(, "kind": ")" + kind + R"("})",
                    R"(, "integrator": "backward_euler", "newton": {"tolerance": 1e-9},
                        "output": {"trajectory": "t.h5", "every": 1})"));
    const Hdf5File file = Hdf5File::open(folder_ / "t.h5");
    std::vector<double> momenta(3 * 61), forces(3 * 61);
    file.open_dataset("/linear_momentum").read(momenta.data(), ElementType::kFloat64);
    const Hdf5Dataset loads = file.open_dataset("/attachments/force");
    ASSERT_EQ(loads.sizes(), (std::vector<std::int64_t>{61, 1, 3})) << kind;
    loads.read(forces.data(), ElementType::kFloat64);
    EXPECT_TRUE(file.has_dataset("/attachments/torque"));
    const double mass = bar_.model.rigid->mass;
    const Eigen::Vector3d weight(0, 0, -9.81 * mass);
    for (std::size_t k = 1; k < 61; ++k) {
      const Eigen::Vector3d rate = (Eigen::Vector3d(&momenta[3 * k]) - Eigen::Vector3d(&momenta[3 * k - 3])) / 0.004;
      EXPECT_LE((rate - weight + Eigen::Vector3d(&forces[3 * k])).norm(), 1e-6 * weight.norm()) << kind << k;
    }
  }
}

// A spring of stiffness k that holds a body of mass m from rest bears k/w^2 g (1 - cos wt) of it, w^2 = k/m, if the
// body is stiff and hangs by its centre: it breaks at half its weight where cos wt = 1/2.
TEST_F(SceneAttachments, BreakUnderTheirForce) {
  const double mass = bar_.model.rigid->mass, stiffness = 100 * mass, time = std::acos(0.5) / 10;
  SceneConfig config = scene(fmt::format(R"({{"vertices": {{"box": {{"min": [-1, -1, -1], "max": [2, 1, 1]}}}},
      "kind": "spring", "stiffness": {}, "break_force": {}}})",
                                         stiffness, 0.5 * 9.81 * mass));
  config.time_step = 0.001;
  config.steps = 200;
  const RunSummary summary = test::run(config);
  ASSERT_EQ(summary.broken.size(), 1U);
  EXPECT_EQ(summary.broken[0].place, "/attachments/0");
  EXPECT_NEAR(summary.broken[0].time, time, 0.004);  // the first step has first order
  EXPECT_NEAR(summary.broken[0].force, 0.5 * 9.81 * mass, 0.03 * 9.81 * mass);
}

TEST_F(SceneAttachments, ThatCannotBeAreRefusedWithTheirPlace) {
  const std::string end = "{" + std::string(kEnd);
  EXPECT_EQ(refusal(end + "}"), "none");
  EXPECT_THAT(refusal(end + R"(, "to": "wrld"})"), HasSubstr(R"(/attachments/0/to: expected "world" or)"));
  EXPECT_THAT(refusal(end + R"(, "to": {"obstacle": 0}})"),
              HasSubstr("/attachments/0/to/obstacle: expected no obstacle"));
  EXPECT_THAT(refusal(end + R"(, "to": {"body": 0}})"), HasSubstr("/attachments/0/to/body: expected \"world\" or an"));
  EXPECT_THAT(refusal(end + R"(, "to": {"vertices": {"ids": [0]}}})"), HasSubstr("/attachments/0/to: expected {\"obs"));
  EXPECT_THAT(refusal(end + R"(, "to": {}})"), HasSubstr("/attachments/0/to: expected"));
  EXPECT_THAT(refusal(end + R"(, "kind": "glue"})"), HasSubstr(R"(/attachments/0/kind: expected "fixed", "ball" or)"));
  EXPECT_THAT(refusal(end + R"(, "stiffness": 5})"), HasSubstr("/attachments/0/stiffness: expected no stiffness"));
  EXPECT_THAT(refusal(end + R"(, "break_force": 0})"), HasSubstr("/attachments/0/break_force: expected a number > 0"));
  EXPECT_THAT(refusal(end + R"(, "body": 1})"), HasSubstr("/attachments/0/body: expected a body of the scene, 0 to 0"));
  EXPECT_THAT(refusal(end + R"(, "body": "bar"})"), HasSubstr("/attachments/0/body: expected a number"));
  EXPECT_THAT(refusal(end + "}, " + end + "}"),
              HasSubstr("/attachments/1/vertices: expected vertices that nothing holds"));
  EXPECT_THAT(refusal(R"({"vertices": {"ids": [100000]}})"), HasSubstr("/attachments/0/vertices"));
  EXPECT_THAT(refusal(R"({"vertices": {"box": {"min": [8, 8, 8], "max": [9, 9, 9]}}})"),
              HasSubstr("/attachments/0/vertices"));
  const std::string moved = end + R"(, "to": {"obstacle": 0}, )" + kTurn + "}";
  EXPECT_THAT(refusal(moved, R"(, "obstacles": [{"plane": {"normal": [0, 0, 1], "point": [0, 0, -9]}}])"),
              HasSubstr("/attachments/0/motion: expected no motion"));
}

TEST_F(SceneAttachments, OfScenesOfSeveralBodiesNameThem) {
  const auto load = [&](const std::string& attachments) {
    test::write_file(folder_ / "world.json", R"({"bodies": [
      {"name": "bar", "bundle": "bar.h5", "grid": {"counts": [3, 1, 1], "spacing": [0, 0, 2]}, "mask": 0},
      {"name": "rod", "bundle": "bar.h5", "mask": 0}], "attachments": [)" +
                                                 attachments + "]}");
    return load_world(folder_ / "world.json");
  };
  const std::string end = "{" + std::string(kEnd) + R"(, "body": )";
  const WorldConfig config = load(end + R"("bar_1"}, )" + end + R"("rod"}, )" + end + "2}, " +
                                  R"({"vertices": {"point": [0, 0, 0]}, "body": "bar"})");
  const LoadedWorld loaded = load_world_run(config);
  const Bodies bodies(loaded, config);
  for (const auto& [body, count] : {std::pair(0, 1U), {1, 2U}, {2, 2U}, {3, 1U}})
    EXPECT_EQ(bodies.world().state(body).attachments.size(), count) << body;
  const auto refusal = [&](const std::string& attachments) -> std::string {
    try {
      load(attachments);
    } catch (const InputError& error) {
      return error.what();
    }
    return "none";
  };
  EXPECT_THAT(refusal(end + R"("rood"})"), HasSubstr(R"(did you mean "rod"?)"));
  EXPECT_THAT(refusal("{" + std::string(kEnd) + "}"), HasSubstr(R"(/attachments/0/body: expected "bar", "bar_0" to)"));
  EXPECT_THAT(refusal(end + "4}"), HasSubstr("/attachments/0/body: expected a body of the scene, 0 to 3"));
}

/// Scenes of three bars in a row, the first two of one kind, with attachments between their ends.
class ScenesOfAttachedBodies : public SceneAttachments {
 protected:
  WorldConfig world(const std::string& attachments, const std::string& more = "", const char* mask = "") const {
    test::write_file(folder_ / "world.json",
                     fmt::format(R"({{"time_step": 0.01, "steps": 20, "gravity": [0, 0, -9.81]{0}, "bodies": [
      {{"name": "bar", "bundle": "bar.h5", "grid": {{"counts": [2, 1, 1], "spacing": [1, 0, 0]}}{2}}},
      {{"name": "rod", "bundle": "bar.h5", "poses": "rod.txt"{2}}}], "attachments": [{1}]}})",
                                 more, attachments, mask));
    test::write_file(folder_ / "rod.txt", "2 0 0\n");
    return load_world(folder_ / "world.json");
  }
  static std::string between(const std::string& own, const std::string& other, const std::string& more) {
    return R"({"body": )" + own + R"(, "vertices": {"box": {"min": [-0.01, -1, -1], "max": [0.01, 1, 1]}}, "to":
      {"body": )" +
           other + R"(, "vertices": {"box": {"min": [0.99, -1, -1], "max": [1.01, 1, 1]}}})" + more + "}";
  }
  std::string refusal(const std::string& attachments, const std::string& more = "") const {
    try {
      const WorldConfig config = world(attachments, more);
      const LoadedWorld loaded = load_world_run(config);
      const Bodies bodies(loaded, config);
    } catch (const InputError& error) {
      return error.what();
    }
    return "none";
  }
};

// Bars that fall as one: all have the same momentum, so that nothing is exerted but by their springs' start.
TEST_F(ScenesOfAttachedBodies, AreOneIslandWhoeverMayTouchWhom) {
  for (const char* mask : {"", R"(, "mask": 0)"}) {
    const WorldConfig config =
        world(between("\"bar_1\"", "\"bar_0\"", "") + ", " + between("\"rod\"", "1", R"(, "kind": "ball")"), "", mask);
    const LoadedWorld loaded = load_world_run(config);
    Bodies bodies(loaded, config);
    EXPECT_EQ(bodies.step().largest_island, 3) << mask;
    EXPECT_TRUE(bodies.world().state(0).attachments.empty());
    const State &first = bodies.world().state(0), &last = bodies.world().state(2);
    EXPECT_NEAR(free_state(first).linear_momentum[2], free_state(last).linear_momentum[2], 1e-9);
  }
}

TEST_F(ScenesOfAttachedBodies, AreTakenUpFromAStateToTheLastBit) {
  const std::string attachments = between("\"bar_1\"", "\"bar_0\"", R"(, "kind": "spring", "damping": 30)") + ", " +
                                  between("\"rod\"", "\"bar_1\"", "") + ", " +
                                  R"({"body": "bar_0", "vertices": {"point": [0, 0, 0]}, "kind": "spring"})";
  WorldConfig config = world(attachments, R"(, "output": {"trajectory": "t.h5", "every": 1})");
  const LoadedWorld loaded = load_world_run(config);
  const RunSummary whole = run(loaded, config);
  config.steps = 10;
  run(loaded, config, {.dump_state = folder_ / "state.json"});
  EXPECT_EQ(run(loaded, config, {.from_state = folder_ / "state.json"}).state_hash, whole.state_hash);
  const Hdf5File file = Hdf5File::open(folder_ / "t.h5");
  EXPECT_EQ(file.open_dataset("/bodies/rod/attachments/force").sizes(), (std::vector<std::int64_t>{11, 1, 3}));
}

TEST_F(ScenesOfAttachedBodies, ThatCannotBeAreRefusedWithTheirPlace) {
  EXPECT_EQ(refusal(between("1", "0", "")), "none");
  EXPECT_THAT(refusal(between("1", "1", "")), HasSubstr("/attachments/0/to/body: expected another body than the one"));
  EXPECT_THAT(refusal(between("\"rod\"", "\"bar\"", "")),
              HasSubstr(R"(/attachments/0/to/body: expected one of "bar_0" to "bar_1")"));
  EXPECT_THAT(refusal(between("\"rod\"", "\"baar_1\"", "")),
              HasSubstr(R"(/attachments/0/to/body: expected "bar", "bar_0" to "bar_1" or "rod")"));
  EXPECT_THAT(refusal(between("\"rod\"", "0", R"(, "motion": [{"time": 0}])")),
              HasSubstr("/attachments/0/motion: expected no motion, since the other body"));
  EXPECT_THAT(refusal(R"({"body": 1, "vertices": {"ids": [0]}, "to": {"body": 0}})"),
              HasSubstr("/attachments/0/to/vertices: expected vertices of that body"));
  EXPECT_THAT(refusal(R"({"body": 1, "vertices": {"ids": [0]}, "to": {"body": 0, "vertices": {"ids": [100000]}}})"),
              HasSubstr("/attachments/0/to/vertices"));
  EXPECT_THAT(refusal(R"({"body": 1, "vertices": {"ids": [0]}, "to": {"body": 0, "vertices": {"ids": [0, 1]}}})"),
              HasSubstr("/attachments/0/vertices: expected three vertices or more"));
  EXPECT_THAT(refusal(R"({"body": 1, "vertices": {"ids": [0]}, "to": {"body": 0, "obstacle": 0}})"),
              HasSubstr("/attachments/0/to: expected an obstacle or a body"));
  EXPECT_THAT(refusal(between("1", "0", ""), R"(, "space": "auto")"),
              HasSubstr("/attachments/0/to: expected two bodies of space reduced"));
}

// In their modes, too, whatever their kind.
TEST_F(SceneAttachments, OfBodiesThatMayTouchHold) {
  for (const char* const kind : {"fixed", "ball", "spring"}) {
    test::write_file(folder_ / "world.json", R"({"bodies": [
      {"name": "bar", "bundle": "bar.h5", "grid": {"counts": [1, 1, 2], "spacing": [0, 0, 2]}}], "attachments": [{)" +
                                                 std::string(kEnd) + R"(, "body": "bar_1", "kind": ")" + kind +
                                                 "\"}]}");
    const WorldConfig config = load_world(folder_ / "world.json");
    const LoadedWorld loaded = load_world_run(config);
    const Bodies bodies(loaded, config);
    EXPECT_EQ(bodies.world().state(1).attachments.size(), 1U) << kind;
  }
}

}  // namespace
}  // namespace exmat::runtime
