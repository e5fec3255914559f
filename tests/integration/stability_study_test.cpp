#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "common/bundle/bundle.h"
#include "tests/integration/support.h"

namespace exmat::test {
namespace {

using namespace nlohmann::literals;
using ::testing::AllOf;
using ::testing::HasSubstr;

/// Small bars without fixed vertices.
class StabilityStudyProgram : public testing::Test {
 protected:
  StabilityStudyProgram() {
    const auto asset =
        write_small_bar(folder_, R"({ "object": { "fixed": null }, "basis": { "training": "none" } })"_json);
    write_bundle(build(asset).model, folder_.path("bundle.h5"));
  }
  Outcome study(const std::filesystem::path& scene) {
    return exmat_precompute(
        {"study", "--stability", scene, "-o", folder_.path("out"), "--log-level", "error", "--threads", "1"});
  }
  Json results() const { return Json::parse(read_file(folder_.path("out/stability.json"))); }

  TemporaryFolder folder_;
};

TEST_F(StabilityStudyProgram, SaysHowFarASceneIsSafe) {
  const Outcome outcome = study(write_scene(folder_, R"({
      "time_step": 0.005, "steps": 60, "gravity": [0, 0, -9.81], "damping": { "mass": 0.5, "stiffness": 0.002 },
      "body": { "position": [0, 0, 0.1], "linear_velocity": [0, 0, -1] },
      "obstacles": [ { "plane": { "normal": [0, 0, 1] }, "stiffness": 2e6, "damping": 1e4, "friction": 0.4 } ] })"_json));
  EXPECT_EQ(outcome.status, 0) << outcome.errors;
  EXPECT_THAT(outcome.output, AllOf(HasSubstr("| time step | 0.005 s |"), HasSubstr("| speed | 1 m/s, 0 rad/s |"),
                                    HasSubstr("| kappa | 0 | not tested: the scene has no example force |")));
  EXPECT_EQ(results()["runs"].size(), 1U + 6 + 2 + 2 + 2 + 3);
  EXPECT_EQ(results()["sound"], true);
  for (const char* name : {"stability.html", "stability.md", "stability.csv"})
    EXPECT_FALSE(read_file(folder_.path("out") / name).empty()) << name;
}

TEST_F(StabilityStudyProgram, TakesBodiesThatTouch) {
  const Outcome outcome = study(folder_.write("scene.json", R"({
      "time_step": 0.005, "steps": 20, "gravity": [0, 0, -9.81], "damping": { "mass": 0.5, "stiffness": 0.002 },
      "contact": { "stiffness": 2e6, "damping": 1e4, "friction": 0.4 },
      "obstacles": [ { "plane": { "normal": [0, 0, 1] }, "stiffness": 2e6, "damping": 1e4, "friction": 0.4 } ],
      "bodies": [ { "name": "low", "bundle": "bundle.h5", "body": { "position": [0, 0, 0.01] } },
                  { "name": "high", "bundle": "bundle.h5", "body": { "position": [0.3, 0.1, 0.85] } } ] })"));
  EXPECT_EQ(outcome.status, 0) << outcome.errors;
  EXPECT_THAT(outcome.output, HasSubstr("| contact stiffness | 2e+06 N/m^3 |"));
  EXPECT_THAT(outcome.output, HasSubstr("momentum: obstacles take momentum"));
}

TEST_F(StabilityStudyProgram, EndsWithStatusOneIfTheSceneFailsAsItIs) {
  const Outcome outcome = study(write_scene(folder_, R"({ "steps": 5, "time_step": 1e-160 })"_json));
  EXPECT_EQ(outcome.status, 1);
  EXPECT_THAT(outcome.errors, HasSubstr("FAILS as it is: finite 1"));
  EXPECT_EQ(results()["sound"], false) << "the report is there";
}

TEST_F(StabilityStudyProgram, RefusesBadUsageAndBadInput) {
  Outcome outcome = exmat_precompute({"study", "--stability", folder_.path("none.json"), "-o", folder_.path("out")});
  EXPECT_EQ(outcome.status, 2);
  EXPECT_THAT(outcome.errors, HasSubstr("none.json"));
  outcome = exmat_precompute({"study", "--stability", folder_.path("scene.json")});
  EXPECT_EQ(outcome.status, 2);
  EXPECT_THAT(outcome.errors, HasSubstr("--output"));
  outcome = study(write_scene(folder_, R"({ "bundle": "other.h5" })"_json));
  EXPECT_EQ(outcome.status, 2);
  EXPECT_THAT(outcome.errors, HasSubstr("other.h5"));
}

}  // namespace
}  // namespace exmat::test
