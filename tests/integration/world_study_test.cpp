#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "common/bundle/bundle.h"
#include "tests/integration/support.h"

namespace exmat::test {
namespace {

using namespace nlohmann::literals;
using ::testing::HasSubstr;

/// Two small bars without fixed vertices, one dropped onto the other, which is dropped onto a floor.
class WorldStudyProgram : public testing::Test {
 protected:
  WorldStudyProgram() {
    write_small_bar(folder_, R"({ "object": { "fixed": null }, "basis": { "training": "none" } })"_json);
    write_scene_of(Json::object());
    write_study(Json::object());
  }

  void write_scene_of(const Json& changes) {
    Json scene = R"({
      "time_step": 0.004, "steps": 50, "gravity": [0, 0, -9.81], "damping": { "mass": 0.5, "stiffness": 0.002 },
      "contact": { "stiffness": 2e6, "damping": 1e4, "friction": 0.4 },
      "obstacles": [ { "plane": { "normal": [0, 0, 1] }, "stiffness": 2e6, "damping": 1e4, "friction": 0.4 } ],
      "bodies": [ { "name": "low", "bundle": "low.h5", "body": { "position": [0, 0, 0.01] } },
                  { "name": "high", "bundle": "high.h5", "body": { "position": [0.3, 0.1, 0.85], "linear_velocity": [0, 0, -2] },
                    "grid": { "counts": [1, 2, 1], "spacing": [1, 1.2, 1] } } ] })"_json;
    scene.merge_patch(changes);
    folder_.write("scene.json", scene.dump());
  }
  void write_study(const Json& changes) {
    Json study = R"({
      "name": "two", "scene": "scene.json", "frames": 10, "timing": {"rounds": 1, "steps": 20},
      "assets": [ { "body": "low", "asset": "asset.json" }, { "body": "high", "asset": "asset.json" } ],
      "sweeps": [ { "basis_size": [6, 24], "linear_modes": [24], "internal_force": ["all_elements"] } ] })"_json;
    study.merge_patch(changes);
    folder_.write("study.json", study.dump());
  }
  Outcome study(std::vector<std::string> options = {}) {
    options.insert(options.begin(),
                   {"study", folder_.path("study.json"), "-o", folder_.path("out"), "--log-level", "error"});
    return exmat_precompute(options);
  }
  Json results() const { return Json::parse(read_file(folder_.path("out/results.json"))); }
  void expect_refused(const std::string& message) {
    const Outcome outcome = study();
    EXPECT_EQ(outcome.status, 2);
    EXPECT_THAT(outcome.errors, HasSubstr(message));
  }

  TemporaryFolder folder_;
};

double mean(const Json& point, const char* body, const char* error) {
  return point["errors"][body][error]["mean"].get<double>();
}

TEST_F(WorldStudyProgram, MeasuresBodiesThatTouchAgainstTheFullSpace) {
  // Most modes beside few: the free motion of 54 vertices has 156.
  write_study(
      R"({ "sweeps": [ { "basis_size": [6, 24, 120], "linear_modes": [20], "internal_force": ["all_elements"] } ],
                   "reference": { "time_step": 0.002 } })"_json);
  const Outcome outcome = study({"--max-error", "50"});
  ASSERT_EQ(outcome.status, 0) << outcome.errors;
  EXPECT_THAT(outcome.output, HasSubstr("recommended: point"));
  const Json found = results();
  EXPECT_EQ(found["bodies"], Json({"low", "high_0", "high_1"}));
  ASSERT_EQ(found["points"].size(), 3U);
  ASSERT_EQ(found["references"].size(), 1U);
  EXPECT_EQ(found["references"][0]["steps"], 100);
  EXPECT_EQ(found["references"][0]["unconverged_steps"], 0);
  double last = std::numeric_limits<double>::infinity();
  for (const Json& point : found["points"]) {
    const double error = mean(point, "all", "position");
    EXPECT_LT(error, last);
    last = error;
    EXPECT_GT(point["times"]["body_step_us"].get<double>(), 0);
    EXPECT_EQ(point["steps"], 50);
    EXPECT_TRUE(point["errors"]["all"]["shape"].is_null());
    for (const char* body : {"low", "high_0"}) EXPECT_GT(mean(point, body, "shape"), 0);
    EXPECT_LE(mean(point, "high_1", "shape"), 1e-9) << "it falls beside the others";
    EXPECT_LE(mean(point, "high_1", "position"), 0.01);
  }
  // Most of what is left is that of the time step, 4 ms against 2.
  EXPECT_LE(last, 0.02);
  EXPECT_GE(mean(found["points"][0], "all", "position"), 2 * last);
}

TEST_F(WorldStudyProgram, GoesOnWhereItWasLeft) {
  ASSERT_EQ(study().status, 0);
  const Json first = results();
  std::map<std::string, std::filesystem::file_time_type> written;
  for (const char* part : {"bundles", "references", "points"})
    for (const auto& entry : std::filesystem::directory_iterator(folder_.path("out") / part))
      written[entry.path()] = entry.last_write_time();
  EXPECT_EQ(written.size(), 2 * 2 * 2 + 3 + 2U) << "of two points and two kinds, of three bodies, of two points";
  std::filesystem::remove(folder_.path("out/results.csv"));
  ASSERT_EQ(study().status, 0);
  for (const auto& [file, time] : written) EXPECT_EQ(std::filesystem::last_write_time(file), time) << file;
  for (std::size_t i = 0; i < 2; ++i) EXPECT_EQ(results()["points"][i]["errors"], first["points"][i]["errors"]);
  EXPECT_THAT(read_file(folder_.path("out/results.csv")), HasSubstr("\n2,high_1,"));
}

// Bars that do not fold touch nothing of themselves, in either space.
TEST_F(WorldStudyProgram, MeasuresBodiesThatMayTouchThemselves) {
  ASSERT_EQ(study().status, 0);
  const Json without = results();
  std::filesystem::remove_all(folder_.path("out"));
  write_scene_of(R"({ "contact": { "self": true } })"_json);
  ASSERT_EQ(study().status, 0);
  for (std::size_t i = 0; i < 2; ++i) EXPECT_EQ(results()["points"][i]["errors"], without["points"][i]["errors"]);
}

TEST_F(WorldStudyProgram, RefusesWhatCannotBeMeasured) {
  write_study(R"({ "assets": [ { "body": "low", "asset": "asset.json" } ] })"_json);
  expect_refused("the asset of \"high\"");
  write_study(R"({ "assets": [ { "body": "low", "asset": "asset.json" }, { "body": "high", "asset": "asset.json" },
                               { "body": "middle", "asset": "asset.json" } ] })"_json);
  expect_refused("/assets/2/body");
  write_study(R"({ "assets": null })"_json);
  expect_refused("asset or assets");
  write_study(R"({ "assets": null, "asset": "asset.json" })"_json);
  expect_refused("the asset of \"low\"");
  write_study(R"({ "sources": {} })"_json);
  expect_refused("no such member with a scene of several bodies");
  write_study(Json::object());
  write_scene_of(
      R"({ "gravity": { "keys": [ { "time": 0, "value": [0, 0, 0] }, { "time": 1, "value": [0, 0, -1] } ] } })"_json);
  expect_refused("studies take no keys");
  folder_.write("scene.json", R"({ "bundle": "low.h5" })");
  expect_refused("since the scene is of one body");
}

}  // namespace
}  // namespace exmat::test
