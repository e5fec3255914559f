#include "runtime/scene/state_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <string>

#include "common/bundle/bundle.h"
#include "common/config/config.h"
#include "common/core/error.h"
#include "tests/support/scene_run.h"
#include "tests/support/synthetic_model.h"
#include "tests/support/temporary_folder.h"

namespace exmat::runtime {
namespace {

using Json = nlohmann::json;
using test::Bar;
using ::testing::HasSubstr;

/// Kinds of bodies differ in what they carry from step to step; each of these has something that the others have not.
struct Case {
  const char* name;
  test::BarOptions bar;
  bool contact;
  const char* members;
};

constexpr const char* kFloor =
    R"(, "obstacles": [{"plane": {"point": [0, -0.02, 0], "normal": [0, 1, 0]}, "stiffness": 1e5, "friction": 0.4}])";

std::vector<Case> cases() {
  const std::string floor = kFloor;
  static const std::string free_members =
      floor + R"(, "body": {"linear_velocity": [0.2, -1, 0], "angular_velocity": [1, 2, 3]})";
  static const std::string full_members = free_members + R"(, "space": "full")";
  return {{"clamped",
           {.examples = 3},
           false,
           R"(, "examples": {"stiffness": 100, "target": "solve", "target_iterations": 1})"},
          {"newmark", {}, false, R"(, "integrator": "newmark", "instances": 3)"},
          {"free", {.free = true}, true, free_members.c_str()},
          {"asleep", {}, false, R"(, "instances": 2, "damping": {"mass": 20}, "sleep": {"energy": 1, "time": 0.15})"},
          {"carried",
           {.carried = true},
           false,
           R"(, "body": {"motion": [{"time": 0}, {"time": 0.15, "position": [0, 0.1, 0]}]})"},
          {"full", {.free = true}, true, full_members.c_str()},
          {"held",
           {.free = true},
           false,
           R"(, "instances": 2, "attachments": [
              {"vertices": {"point": [1, 0, 0]}, "kind": "ball",
               "motion": [{"time": 0}, {"time": 0.3, "position": [0, 0.1, 0]}]},
              {"vertices": {"point": [0, 0, 0]}, "kind": "spring", "stiffness": 500, "damping": 20, "body": 1},
              {"vertices": {"point": [0, 0.25, 0]}, "kind": "spring", "stiffness": 1e4, "break_force": 60}])"},
          {"held_in_full",
           {.free = true},
           false,
           R"(, "space": "full", "attachments": [
              {"vertices": {"point": [1, 0, 0]}, "motion": [{"time": 0}, {"time": 0.3, "position": [0, 0.1, 0]}]},
              {"vertices": {"point": [0, 0, 0]}, "kind": "spring", "stiffness": 500, "damping": 20}])"},
          {"auto",
           {},
           false,
           R"(, "space": "auto", "space_release": 0.1,
              "forces": [{"vertices": {"ids": [60]}, "force": [0, 1, 0], "start": 0.05, "end": 0.15}])"}};
}

class StateFile : public ::testing::TestWithParam<Case> {
 protected:
  void make(const Case& test) {
    Bar bar = test::make_bar(test.bar);
    if (test.contact) bar.model.contact = test::surface_contact(bar.model);
    bar.model.input_sha256 = std::string(64, 'a');
    write_bundle(bar.model, folder_.path() / "bar.h5");
  }
  SceneConfig scene(const std::string& members, int steps = 20) const {
    const std::string text = R"({"bundle": "bar.h5", "time_step": 0.01, "gravity": [0, -9.81, 0], "steps": )" +
                             std::to_string(steps) + members + "}";
    const auto file = folder_.path() / "scene.json";
    test::write_file(file, text);
    return load_scene(file);
  }
  std::filesystem::path state() const { return folder_.path() / "state.json"; }

  test::TemporaryFolder folder_;
};

// The bits of all bodies, of frames and contacts too: of 40 steps in one run, and in two with a file between them.
TEST_P(StateFile, ARunThatIsTakenUpIsTheWholeRunToTheLastBit) {
  make(GetParam());
  const std::uint64_t whole = test::run(scene(GetParam().members, 40)).state_hash;
  for (const int first : {1, 19, 20}) {
    const SceneConfig before = scene(GetParam().members, first), after = scene(GetParam().members, 40 - first);
    test::run(before, {.dump_state = state()});
    const RunSummary summary = test::run(after, {.from_state = state()});
    EXPECT_EQ(summary.state_hash, whole) << first;
    EXPECT_EQ(summary.steps, 40 - first);
  }
}

TEST_P(StateFile, WhatIsWrittenAgainIsTheSame) {
  make(GetParam());
  const SceneConfig config = scene(GetParam().members);
  const test::LoadedRun loaded(config);
  loaded.run({.dump_state = state()});
  const BodiesMemory memory = read_state(state(), loaded.world, loaded.config);
  write_state(memory, loaded.world, loaded.config, folder_.path() / "again.json");
  EXPECT_EQ(test::read_file(folder_.path() / "again.json"), test::read_file(state()));
}

INSTANTIATE_TEST_SUITE_P(Bodies, StateFile, ::testing::ValuesIn(cases()),
                         [](const auto& test) { return std::string(test.param.name); });

using BadStateFile = StateFile;

TEST_F(BadStateFile, ContactsAreThere) {
  make(cases()[2]);
  const SceneConfig config = scene(cases()[2].members, 30);
  test::run(config, {.dump_state = state()});
  EXPECT_FALSE(Json::parse(test::read_file(state()))["bodies"][0]["contacts"].empty());
}

TEST_F(BadStateFile, IsRefusedWithThePlace) {
  make(cases()[2]);
  const SceneConfig config = scene(cases()[2].members, 30);
  const test::LoadedRun loaded(config);
  loaded.run({.dump_state = state()});
  const Json good = Json::parse(test::read_file(state()));
  const auto refusal = [&](const char* pointer, const Json& value) -> std::string {
    Json bad = good;
    bad[Json::json_pointer(pointer)] = value;
    test::write_file(state(), bad.dump());
    try {
      read_state(state(), loaded.world, loaded.config);
    } catch (const InputError& error) {
      return error.what();
    }
    return "none";
  };
  EXPECT_THAT(refusal("/format_version", 2),
              HasSubstr("state.json: /format_version: expected a state of a scene of one"));
  EXPECT_THAT(refusal("/format", "exmat-report"), HasSubstr("state.json: /format: expected"));
  EXPECT_THAT(refusal("/bundle_input_sha256", "b"), HasSubstr("state.json: /bundle_input_sha256: expected \"aaaa"));
  EXPECT_THAT(refusal("/time_step", 0.02), HasSubstr("state.json: /time_step: expected 0.01"));
  EXPECT_THAT(refusal("/bodies/1", good["bodies"][0]), HasSubstr("state.json: /bodies: expected 1"));
  EXPECT_THAT(refusal("/bodies/0/reduced", Json::array({1.0})), HasSubstr("state.json: /bodies/0/reduced: expected"));
  EXPECT_THAT(refusal("/bodies/0/frame", Json::array({1.0})), HasSubstr("state.json: /bodies/0/frame: expected"));
  EXPECT_THAT(refusal("/bodies/0/examples", Json::parse(R"([{"weights": [1], "target": [], "has_target": false,
                                                             "target_converged": false}])")),
              HasSubstr("state.json: /bodies/0/examples: expected 0 entries"));
  EXPECT_THAT(refusal("/bodies/0/contacts/0/vertex", 100000), HasSubstr("/bodies/0/contacts/0: expected a vertex"));
  EXPECT_THAT(refusal("/bodies/0/contacts/0/obstacle", 1), HasSubstr("/bodies/0/contacts/0: expected an obstacle"));
  EXPECT_THAT(refusal("/bodies/0/steps", 1), HasSubstr("step"));
}

TEST_F(BadStateFile, HoldsTheStateBeforeAStepThatFails) {
  make({"clamped", {}, false, ""});
  SceneConfig config = scene(R"(, "forces": [{"vertices": {"ids": [62]}, "force": [0, 1, 0], "start": 0.1}])");
  config.forces.front().force[1] = 1e300;
  EXPECT_THROW(test::run(config, {.dump_state = state()}), WorkError);
  EXPECT_EQ(Json::parse(test::read_file(state()))["bodies"][0]["step"], 10);
  EXPECT_THROW(test::run(config, {.from_state = state()}), WorkError);
}

}  // namespace
}  // namespace exmat::runtime
