#include <algorithm>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <map>

#include "common/bundle/bundle.h"
#include "tests/integration/support.h"

namespace exmat::test {
namespace {

using namespace nlohmann::literals;
using ::testing::HasSubstr;

/// The small bar, a scene of it, and a study of a few points.
class StudyProgram : public testing::Test {
 protected:
  StudyProgram() {
    write_small_bar(folder_);
    write_scene(folder_, R"({
      "time_step": 0.01, "steps": 40, "gravity": [0, -2, 1], "damping": { "mass": 0.5, "stiffness": 0.001 },
      "examples": { "stiffness": 300, "damping": 5, "bias": 0.7 } })"_json);
  }
  void write_study(const Json& members = Json::object()) {
    Json study = R"({
      "name": "small", "asset": "asset.json", "scene": "scene.json", "frames": 10, "timing": {"rounds": 1, "steps": 20},
      "sweeps": [ { "basis_size": [8, 12], "internal_force": ["cubature", "all_elements"], "target": ["solve"] } ] })"_json;
    study.merge_patch(members);
    folder_.write("study.json", study.dump());
  }
  Outcome study(const std::string& output, std::vector<std::string> options = {}) {
    options.insert(options.begin(),
                   {"study", folder_.path("study.json"), "-o", folder_.path(output), "--log-level", "error"});
    return exmat_precompute(options);
  }
  Json results(const std::string& output) const {
    return Json::parse(read_file(folder_.path(output + "/results.json")));
  }

  /// Errors of the points by their settings.
  static std::map<std::string, Json> errors(const Json& results) {
    std::map<std::string, Json> errors;
    for (const Json& point : results["points"]) errors[point["settings"].dump()] = point["errors"];
    return errors;
  }
  std::map<std::string, std::filesystem::file_time_type> written(const std::string& output) const {
    std::map<std::string, std::filesystem::file_time_type> times;
    for (const char* part : {"bundles", "references", "points", "timing"})
      for (const auto& entry : std::filesystem::directory_iterator(folder_.path(output + "/" + part)))
        times[entry.path()] = entry.last_write_time();
    return times;
  }

  TemporaryFolder folder_;
};

// Against the same body in double, which damping by a stiffness in single precision moves a little.
TEST_F(StudyProgram, MixedPrecisionIsMeasuredAgainstDouble) {
  write_study(
      R"({"sweeps": [ { "basis_size": [8], "precision": ["double", "mixed"], "internal_force": ["cubature"] } ]})"_json);
  const Outcome outcome = study("out");
  ASSERT_EQ(outcome.status, 0) << outcome.errors;
  const Json json = results("out");
  ASSERT_EQ(json["points"].size(), 2U);
  EXPECT_EQ(json["points"][0]["bundle"], json["points"][1]["bundle"]);
  const Json &exact = json["points"][0]["errors"], &mixed = json["points"][1]["errors"];
  EXPECT_TRUE(exact["from_double"].is_null());
  const double difference = mixed["from_double"]["mean"], error = exact["position"]["mean"];
  EXPECT_GT(difference, 0);
  EXPECT_LT(difference, 1e-5);
  EXPECT_NEAR(mixed["position"]["mean"], error, difference + 1e-12) << "the triangle inequality";
}

// All vertices leave nothing out: what is left is what directions of a step are solved to. Steps of eight modes are off
// by what these lose.
TEST_F(StudyProgram, SpacesAreMeasuredBesideEachOther) {
  write_study(R"({"sweeps": [ { "basis_size": [8], "space": ["reduced", "full"] } ]})"_json);
  const Outcome outcome = study("out");
  ASSERT_EQ(outcome.status, 0) << outcome.errors;
  const Json json = results("out");
  ASSERT_EQ(json["points"].size(), 2U);
  EXPECT_EQ(json["points"][1]["settings"]["space"], "full");
  EXPECT_EQ(json["points"][0]["bundle"], json["points"][1]["bundle"]);
  const double reduced = json["points"][0]["errors"]["position"]["mean"],
               full = json["points"][1]["errors"]["position"]["mean"];
  EXPECT_LT(full, 5e-3);
  EXPECT_LT(full, 0.5 * reduced);
}

TEST_F(StudyProgram, MeasuresAndAnswersABudget) {
  write_study();
  const Outcome outcome = study("out", {"--max-error", "1000"});
  ASSERT_EQ(outcome.status, 0) << outcome.errors;
  EXPECT_THAT(outcome.output, HasSubstr("at most 1000 %: point"));
  const Json json = results("out");
  ASSERT_EQ(json["points"].size(), 4U);
  std::map<std::pair<int, bool>, double> mean;
  for (const Json& point : json["points"]) {
    const bool all = point["settings"]["internal_force"] == "all_elements";
    mean[{point["modes"], all}] = point["errors"]["position"]["mean"];
    EXPECT_EQ(point["steps"], 40);
    EXPECT_EQ(point["elements"], all ? 54 : 12) << "a ring for each vertex";
    EXPECT_GT(point["times"]["median_us"], 0);
    EXPECT_EQ(point["errors"]["from_all_elements"].is_null(), all);
  }
  EXPECT_LT((mean[{12, true}]), (mean[{8, true}])) << "more modes";
  EXPECT_EQ(json["references"].size(), 1U);
  const Json asset = Json::parse(read_file(folder_.path("out/recommended_asset.json")));
  EXPECT_EQ(asset["basis"]["size"], json["points"][json["recommended"].get<int>()]["settings"]["basis_size"]);
  EXPECT_EQ(Json::parse(read_file(folder_.path("out/recommended_scene.json")))["examples"]["target"], "solve");
  const std::string report = read_file(folder_.path("out/report.html"));
  EXPECT_THAT(report, HasSubstr("Error against run time"));
  EXPECT_LT(report.size(), 400000U);
}

TEST_F(StudyProgram, ResumesWithoutDoingAgainWhatIsFinished) {
  write_study();
  ASSERT_EQ(study("out").status, 0);
  const auto first = written("out");
  const Json before = results("out");
  const Outcome again = study("out", {"--budget-us", "1e-3"});
  EXPECT_EQ(again.status, 1) << "nothing is that fast";
  EXPECT_THAT(again.errors, HasSubstr("no point; the nearest is point"));
  EXPECT_EQ(written("out"), first);
  EXPECT_EQ(errors(results("out")), errors(before));
  EXPECT_EQ(results("out")["points"][0]["times"], before["points"][0]["times"]);

  // A damaged point and a damaged reference are done again, with what is new; the others are left alone.
  const std::string damaged = folder_.path("out/points/" + before["points"][0]["key"].get<std::string>() + ".json");
  const std::string reference =
      folder_.path("out/references/" + before["references"][0]["key"].get<std::string>() + ".frames");
  write_file(damaged, read_file(damaged).substr(0, 100));
  write_file(reference, "no frames");
  write_study(
      R"({"sweeps": [ { "basis_size": [8, 12], "internal_force": ["cubature", "all_elements"], "target": ["solve"] },
                              { "basis_size": [10], "target": ["solve"] },
                              { "basis_size": [8], "internal_force": ["polynomial"], "target": ["solve"] } ]})"_json);
  ASSERT_EQ(study("out").status, 0);
  const auto after = written("out");
  const Json now = results("out");
  ASSERT_EQ(now["points"].size(), 6U);
  for (const auto& [settings, error] : errors(before)) EXPECT_EQ(errors(now)[settings], error) << settings;
  for (const auto& [file, time] : first) {
    const bool renewed =
        file == damaged || file == reference || file.starts_with(damaged.substr(0, damaged.size() - 5));
    EXPECT_EQ(after.at(file) == time, !renewed) << file;
  }
}

// One run of the full space for all points, at the same times; what a long step loses is an error then.
TEST_F(StudyProgram, MeasuresByAReferenceOfAnotherTimeStep) {
  // Stiffer than the material, so that steps of 0.02 s are long.
  write_small_bar(folder_, R"({ "object": { "formulation": "linear" } })"_json);
  const Json sweeps =
      R"([ { "basis_size": [12], "time_step": [0.02, 0.01], "internal_force": ["all_elements"] } ])"_json;
  write_scene(folder_, R"({ "time_step": 0.01, "steps": 40, "gravity": [0, -2, 1] })"_json);
  const auto means = [&](const std::string& output) {
    EXPECT_EQ(study(output).status, 0);
    std::map<double, double> found;
    const Json json = results(output);
    for (const Json& point : json["points"])
      found[point["settings"]["time_step"]] = point["errors"]["position"]["mean"];
    return found;
  };
  write_study({{"sweeps", sweeps}});
  auto own = means("own");
  EXPECT_EQ(results("own")["references"].size(), 2U) << "each point's own time step";
  write_study({{"sweeps", sweeps}, {"reference", {{"time_step", 0.0025}}}});
  auto fine = means("fine");
  const Json json = results("fine");
  ASSERT_EQ(json["references"].size(), 1U);
  EXPECT_EQ(json["references"][0]["time_step"], 0.0025);
  EXPECT_EQ(json["references"][0]["steps"], 160);
  EXPECT_EQ(json["points"][0]["steps"], 20);
  EXPECT_EQ(json["points"][1]["steps"], 40);
  EXPECT_GT(fine[0.02], 1.2 * own[0.02]) << "the time step's error is among it";
  EXPECT_LT(fine[0.01], fine[0.02]);
  write_study({{"reference", {{"time_step", 0.0137}}}});
  const Outcome refused = study("none");
  EXPECT_EQ(refused.status, 2);
  EXPECT_THAT(refused.errors, HasSubstr("study.json: /sweeps: expected time steps with a common multiple"));
}

// The front is that of the errors of shape, by its definition.
TEST_F(StudyProgram, ChoosesFreeBodiesByTheirShape) {
  write_small_bar(folder_, R"({ "object": { "fixed": null } })"_json);
  write_scene(folder_, R"({
    "time_step": 0.01, "steps": 100, "gravity": [0, 0, -10], "body": { "linear_velocity": [0, 0, -3] },
    "obstacles": [ { "plane": { "point": [0, 0, -0.1], "normal": [0, 0, 1] }, "stiffness": 1e6 } ] })"_json);
  write_study(
      R"({"sweeps": [ { "basis_size": [6, 8, 12], "linear_modes": [4, 6], "internal_force": ["all_elements"] } ]})"_json);
  const Outcome outcome = study("out", {"--max-error", "1000"});
  ASSERT_EQ(outcome.status, 0) << outcome.errors;
  EXPECT_THAT(outcome.output, HasSubstr("shape [%]"));
  const Json json = results("out");
  EXPECT_EQ(json["headline"], "shape");
  const Json& points = json["points"];
  ASSERT_EQ(points.size(), 6U);
  // Times are in whole nanoseconds: two may be equal.
  const auto beaten = [&](const Json& point) {
    return std::any_of(points.begin(), points.end(), [&](const Json& other) {
      const double error = other["errors"]["shape"]["mean"], limit = point["errors"]["shape"]["mean"];
      const double time = other["times"]["median_us"], most = point["times"]["median_us"];
      return error <= limit && time <= most && (error < limit || time < most);
    });
  };
  for (std::size_t i = 0; i < points.size(); ++i) {
    const bool on_front = std::find(json["front"].begin(), json["front"].end(), i) != json["front"].end();
    EXPECT_EQ(on_front, !beaten(points[i])) << i;
    const Json& errors = points[i]["errors"];
    EXPECT_NE(errors["shape"]["mean"], errors["position"]["mean"]);
    EXPECT_LE(errors["nearest_phase"]["mean"], errors["shape"]["mean"]);
    EXPECT_GT(errors["rebound"], 0) << "it bounces";
  }
  EXPECT_EQ(json["no_truth"], "");
}

// So heavy that the material turns inside out.
TEST_F(StudyProgram, MarksAReferenceThatIsNoTruth) {
  write_scene(folder_, R"({ "time_step": 0.01, "steps": 20, "gravity": [-600, 0, 0], "damping": { "mass": 5 } })"_json);
  write_study(R"({"sweeps": [ { "internal_force": ["all_elements"] } ]})"_json);
  const Outcome outcome = exmat_precompute({"study", folder_.path("study.json"), "-o", folder_.path("out")});
  ASSERT_EQ(outcome.status, 0) << outcome.errors;
  EXPECT_THAT(outcome.errors, HasSubstr("use the material stable_neo_hookean"));
  const Json json = results("out");
  EXPECT_EQ(json["references"][0]["no_truth"], true);
  EXPECT_GT(json["references"][0]["inverted_tets"]["most"], 0);
  EXPECT_THAT(read_file(folder_.path("out/report.html")), HasSubstr("(no truth)"));
  // By the frames of the full space themselves.
  const Outcome full = exmat_precompute({"bundle", folder_.path("asset.json"), "-o", folder_.path("bundle.h5")});
  ASSERT_EQ(full.status, 0) << full.errors;
  const Outcome run = exmat_precompute({"full-space", folder_.path("scene.json"), "-o", folder_.path("full.h5")});
  EXPECT_EQ(run.status, 0);
  EXPECT_THAT(run.errors, HasSubstr("inverted"));
}

// Whose basis is nearer is for fidelity_test.cpp to say; here they must be two.
TEST_F(StudyProgram, SweepsWhatBasesLearnFrom) {
  write_study(
      R"({"sweeps": [ { "training": ["none", "scene"], "internal_force": ["all_elements"], "target": ["solve"] } ]})"_json);
  const Outcome outcome = study("out");
  ASSERT_EQ(outcome.status, 0) << outcome.errors;
  const Json points = results("out")["points"];
  ASSERT_EQ(points.size(), 2U);
  EXPECT_NE(points[0]["bundle"], points[1]["bundle"]);
  EXPECT_EQ(points[0]["reference"], points[1]["reference"]) << "the full space has no basis";
  const auto basis = [&](const Json& point) {
    return read_bundle(folder_.path("out/bundles/" + point["bundle"].get<std::string>() + ".h5")).modal->basis;
  };
  EXPECT_GT((basis(points[0]) - basis(points[1])).norm(), 0.1 * basis(points[0]).norm());
  // The point with "none" has the asset's own basis.
  const ReducedModel alone = build(folder_.path("asset.json"), std::nullopt).model;
  EXPECT_LE((basis(points[0]) - alone.modal->basis).norm(), 1e-9 * alone.modal->basis.norm());
}

TEST_F(StudyProgram, GivesTheSameErrorsWithMoreJobs) {
  write_study();
  ASSERT_EQ(study("one", {"--jobs", "1"}).status, 0);
  ASSERT_EQ(study("two", {"--jobs", "2"}).status, 0);
  EXPECT_EQ(errors(results("one")), errors(results("two")));
}

TEST_F(StudyProgram, TellsWhatFailedAndGoesOn) {
  write_study(R"({"sweeps": [ { "basis_size": [8, 5000], "target": ["solve"] } ]})"_json);
  const Outcome outcome = study("out");
  EXPECT_EQ(outcome.status, 1);
  EXPECT_THAT(outcome.errors, HasSubstr("1 of 2 points"));
  const Json json = results("out");
  EXPECT_EQ(json["points"][0]["failure"], "");
  EXPECT_GT(json["points"][0]["times"]["median_us"], 0);
  EXPECT_THAT(json["points"][1]["failure"].get<std::string>(), HasSubstr("/basis/size"));
  EXPECT_THAT(read_file(folder_.path("out/report.html")), HasSubstr("/basis/size"));
}

TEST_F(StudyProgram, RefusesBadStudies) {
  write_study({{"sweeps", Json::array({{{"time_step", {0.01, 0.0137}}}})}});
  Outcome outcome = study("out");
  EXPECT_EQ(outcome.status, 2);
  EXPECT_THAT(outcome.errors, HasSubstr("study.json: /sweeps: expected time steps with a common multiple"));
  write_study({{"asset", "none.json"}});
  outcome = study("out");
  EXPECT_EQ(outcome.status, 2);
  EXPECT_THAT(outcome.errors, HasSubstr("none.json"));
  write_study();
  EXPECT_EQ(study("out", {"--jobs", "0"}).status, 2);
  EXPECT_FALSE(std::filesystem::exists(folder_.path("out")));
}

}  // namespace
}  // namespace exmat::test
