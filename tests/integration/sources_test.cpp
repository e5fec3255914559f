#include <cmath>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <map>

#include "common/bundle/bundle.h"
#include "common/hdf5/hdf5_file.h"
#include "tests/integration/support.h"
#include "tests/support/box_mesh.h"

namespace exmat::test {
namespace sources_test {

using namespace nlohmann::literals;
using ::testing::HasSubstr;

const Json kScene = R"({
  "time_step": 0.01, "steps": 40, "gravity": [0, -2, 1], "damping": { "mass": 0.5, "stiffness": 0.001 },
  "examples": { "stiffness": 300, "damping": 5, "bias": 0.7, "target": "table" } })"_json;
constexpr int kFrames = 10, kEvery = 4;

// Positions at the frames of a study.
using Motion = std::vector<Eigen::VectorXd>;

/// The small bar, and the programs beside the study that its parts are measured by again.
class Sources : public testing::Test {
 protected:
  Sources() {
    write_small_bar(folder_);
    write_scene(folder_, kScene);
  }

  Json split(const Json& sources, const Json& study = Json::object(), const std::string& output = "out") {
    write_study(sources, study);
    const Outcome outcome = run(output);
    EXPECT_EQ(outcome.status, 0) << outcome.errors;
    return Json::parse(read_file(folder_.path(output + "/results.json")))["sources"];
  }
  void write_study(const Json& sources, const Json& members = Json::object()) const {
    Json study = {{"name", "small"},   {"asset", "asset.json"}, {"scene", "scene.json"},
                  {"frames", kFrames}, {"sources", sources},    {"timing", {{"rounds", 1}, {"steps", 20}}}};
    if (sources.is_null()) study.erase("sources");
    study.merge_patch(members);
    folder_.write("study.json", study.dump());
  }
  Outcome run(const std::string& output, std::vector<std::string> options = {}) const {
    options.insert(options.begin(),
                   {"study", folder_.path("study.json"), "-o", folder_.path(output), "--log-level", "error"});
    return exmat_precompute(options);
  }
  static Json part(const Json& split, const std::string& source) {
    for (const Json& part : split["parts"])
      if (part["source"] == source) return part;
    ADD_FAILURE() << source;
    return {};
  }
  static double added(const Json& split, const std::string& source) {
    return part(split, source)["added"]["mean"].get<double>();
  }

  /// By `exmat-precompute bundle`, of the asset with changes.
  void make_bundle(const std::string& name, const Json& changes, const std::string& asset = "asset.json") const {
    Json json = Json::parse(read_file(folder_.path(asset)));
    json.merge_patch(changes);
    folder_.write("other_asset.json", json.dump());
    const Outcome made = exmat_precompute({"bundle", folder_.path("other_asset.json"), "-o", folder_.path(name)});
    ASSERT_EQ(made.status, 0) << made.errors;
  }
  /// Motion of the scene with changes on a bundle, by one of the two programs; `every` step is a frame.
  Motion motion(bool full_space, const std::string& bundle, const Json& changes = Json::object(),
                int every = kEvery) const {
    Json scene = kScene;
    scene["bundle"] = bundle;
    scene["output"] = {{"trajectory", "run.h5"}, {"every", every}};
    scene.merge_patch(changes);
    folder_.write("other_scene.json", scene.dump());
    const Outcome ran =
        full_space ? exmat_precompute({"full-space", folder_.path("other_scene.json"), "-o", folder_.path("run.h5")})
                   : exmat_runtime({"run", folder_.path("other_scene.json")});
    EXPECT_EQ(ran.status, 0) << ran.errors;
    const Hdf5File file = Hdf5File::open(folder_ / "run.h5");
    const Hdf5Dataset dataset = file.open_dataset("/vertices");
    std::vector<float> values(dataset.element_count());
    dataset.read(values.data(), ElementType::kFloat32);
    const std::size_t size = values.size() / (kFrames + 1);
    Motion frames;
    for (std::size_t i = 1; i <= kFrames; ++i)
      frames.emplace_back(
          Eigen::Map<const Eigen::VectorXf>(values.data() + i * size, static_cast<Eigen::Index>(size)).cast<double>());
    return frames;
  }
  /// Root mean square of the distance, in the mass by its definition, over that of the third's displacement.
  double distance(const Motion& a, const Motion& b, const Motion& full) const {
    const ReducedModel data = read_bundle(folder_.path("bundle.h5"));
    const TetMesh& mesh = data.object->mesh;
    const Eigen::VectorXd rest = mesh.vertices.reshaped<Eigen::RowMajor>();
    double apart = 0, size = 0;
    for (std::size_t i = 0; i < kFrames; ++i) {
      const Eigen::VectorXd d = a[i] - b[i], u = full[i] - rest;
      apart += mass_product(mesh, data.object->materials.density, d, d);
      size += mass_product(mesh, data.object->materials.density, u, u);
    }
    return std::sqrt(apart / size);
  }
  std::map<std::string, std::filesystem::file_time_type> written(const std::string& output) const {
    std::map<std::string, std::filesystem::file_time_type> times;
    for (const auto& entry : std::filesystem::directory_iterator(folder_.path(output + "/sources")))
      if (entry.is_regular_file()) times[entry.path()] = entry.last_write_time();
    return times;
  }
  /// The same object, whose pose is of its own mesh.
  void write_exact_asset() const {
    const BarFiles bar{.cells = {8, 2, 1}};
    TetMesh mesh = box_mesh(bar.cells, bar.lengths);
    mesh.vertices = twisted(mesh.vertices, bar);
    write_msh(folder_.path("own_twist.msh"), mesh);
    Json asset = Json::parse(read_file(folder_.path("asset.json")));
    asset["examples"] = R"([ { "name": "twist", "mesh": "own_twist.msh" } ])"_json;
    folder_.write("exact.json", asset.dump());
  }

  TemporaryFolder folder_;
};

// Every part, and the total, again by the programs for bundles, full space and run time.
TEST_F(Sources, AreTheDistancesOfMotionsThatTheProgramsMake) {
  const Json found = split({{"eigenfunctions", 12}});
  EXPECT_EQ(found["failure"], "");
  ASSERT_EQ(found["parts"].size(), 7U);
  const char* all[] = {"time_step", "eigenfunctions", "targets", "basis", "cubature", "table"};
  for (const char* error : {"mean", "max", "end", "settled"}) {
    double sum = 0;
    for (const char* source : all) sum += part(found, source)["added"][error].get<double>();
    EXPECT_NEAR(found["sum"][error], sum, 1e-12) << error;
    EXPECT_LE(found["total"][error].get<double>(), sum) << error;
    EXPECT_GE(found["total"][error], 0.01) << error << ": eight modes cannot follow";
  }
  EXPECT_EQ(part(found, "table")["so_far"], found["total"]);
  EXPECT_EQ(part(found, "alignment")["status"], "not_known");
  EXPECT_TRUE(part(found, "alignment")["added"].is_null());
  EXPECT_THAT(part(found, "alignment")["note"].get<std::string>(), HasSubstr("twist is on the mesh of the rest"));

  const Json solve = {{"examples", {{"target", "solve"}, {"target_iterations", 1000}}}};
  const Json all_tets = {{"cubature", {{"method", "all_elements"}, {"elements", nullptr}}}};
  make_bundle("bundle.h5", Json::object());
  make_bundle("more.h5", {{"shape_space", {{"eigenfunctions", 12}}}});
  make_bundle("all.h5", all_tets);
  const Motion full = motion(true, "more.h5", {{"time_step", 0.005}, {"steps", 80}}, 2 * kEvery);
  const Motion longer_steps = motion(true, "more.h5"), fewer_functions = motion(true, "bundle.h5");
  const Motion basis = motion(false, "all.h5", solve), cubature = motion(false, "bundle.h5", solve);
  const Motion point = motion(false, "bundle.h5");
  // Programs seek targets in all poses or among 1e-3 of elements, and write single precision.
  const auto expect = [&](const char* source, const Motion& motion, const Motion& before, double margin) {
    const double expected = distance(motion, before, full);
    EXPECT_NEAR(added(found, source), expected, margin * expected + 1e-5) << source;
  };
  expect("time_step", longer_steps, full, 1e-3);
  expect("eigenfunctions", fewer_functions, longer_steps, 1e-3);
  expect("basis", basis, fewer_functions, 0.02);
  expect("cubature", cubature, basis, 0.02);
  EXPECT_NEAR(found["total"]["mean"], distance(point, full, full), 1e-4);
  EXPECT_LE(added(found, "targets"), 1e-4) << "targets.tolerance";
  EXPECT_LE(added(found, "table"), 1e-3);
}

TEST_F(Sources, OfCubatureAreNoneWithAllElements) {
  const Json found = split({{"time_steps", 1}}, {{"sweeps", {{{"internal_force", {"all_elements"}}}}}});
  EXPECT_EQ(added(found, "cubature"), 0);
  EXPECT_GT(added(found, "basis"), 0.01);
  EXPECT_EQ(part(found, "time_step")["status"], "left_out");
  EXPECT_THAT(found["advice"].get<std::string>(), HasSubstr("basis.training"));
}

// A table and the run time's own solver on the same bundle; a finer table has fewer errors.
TEST_F(Sources, OfTheTableFallWithItsNodes) {
  const auto table_error = [&](double tolerance, const std::string& output) {
    write_small_bar(folder_, {{"targets", {{"tolerance", tolerance}}}});
    return added(split({{"time_steps", 1}}, Json::object(), output), "table");
  };
  const double coarse = table_error(0.3, "coarse");
  make_bundle("bundle.h5", {{"targets", {{"tolerance", 0.3}}}});
  const Motion table = motion(false, "bundle.h5"),
               solve = motion(false, "bundle.h5", {{"examples", {{"target", "solve"}, {"target_iterations", 1000}}}});
  make_bundle("more.h5", {{"shape_space", {{"eigenfunctions", 12}}}});
  const double expected = distance(table, solve, motion(true, "more.h5"));
  EXPECT_GT(coarse, 1e-4);
  EXPECT_NEAR(coarse, expected, 0.1 * expected) << "elements lose 1e-3 of a target";
  EXPECT_LT(table_error(1e-4, "fine"), 0.1 * coarse);
}

// The two examples' motions in full space, of the bundles of the two assets.
TEST_F(Sources, OfAlignmentAreMeasuredByExactExamples) {
  write_exact_asset();
  const Json found = split({{"time_steps", 1}, {"exact_examples", "exact.json"}});
  make_bundle("bundle.h5", Json::object());
  make_bundle("exact.h5", Json::object(), "exact.json");
  make_bundle("more.h5", {{"shape_space", {{"eigenfunctions", 12}}}}, "exact.json");
  const Motion full = motion(true, "more.h5"), exact = motion(true, "exact.h5");
  const double expected = distance(motion(true, "bundle.h5"), exact, full);
  EXPECT_GT(expected, 1e-4);
  EXPECT_NEAR(added(found, "alignment"), expected, 1e-3 * expected + 1e-6);
  EXPECT_NEAR(added(found, "eigenfunctions"), distance(exact, full, full), 1e-4);
  const Json none = split({{"time_steps", 1}}, {{"asset", "exact.json"}}, "own");
  EXPECT_EQ(part(none, "alignment")["status"], "none");
  EXPECT_TRUE(part(none, "alignment")["added"].is_null());
}

TEST_F(Sources, OfFreeBodiesWithoutExamplesAreOfTheirShape) {
  write_small_bar(folder_, R"({ "object": { "fixed": null } })"_json);
  write_scene(folder_, R"({
    "time_step": 0.01, "steps": 40, "gravity": [0, 0, -10], "body": { "linear_velocity": [0, 0, -3] },
    "obstacles": [ { "plane": { "point": [0, 0, -0.1], "normal": [0, 0, 1] }, "stiffness": 1e6 } ] })"_json);
  const Json found = split(Json::object());
  for (const char* source : {"eigenfunctions", "alignment", "targets", "table"})
    EXPECT_EQ(part(found, source)["status"], "none") << source;
  for (const char* error : {"mean", "max", "end", "settled"}) EXPECT_LE(found["total"][error], found["sum"][error]);
  EXPECT_GT(added(found, "time_step"), 0);
  EXPECT_GT(added(found, "basis"), 0.01);
  // With the full problem's time step, the total is the point's own error.
  const Json same = split({{"time_steps", 1}});
  const Json point = Json::parse(read_file(folder_.path("out/results.json")))["points"][0];
  EXPECT_NEAR(same["total"]["mean"], point["errors"]["shape"]["mean"], 1e-12);
  EXPECT_THAT(read_file(folder_.path("out/sources.md")), HasSubstr("Error of shape against full space"));
}

// All motions begin at the same deformation, whatever the full problem makes of the pose: in 0.1 ms none has gone far.
TEST_F(Sources, OfABodyThatBeginsInAPose) {
  write_scene(folder_, R"({ "time_step": 1e-5, "steps": 10, "body": { "pose": { "example": "twist", "weight": 0.5 } },
    "examples": { "stiffness": 300, "bias": 0.7 } })"_json);
  const Json found = split({{"time_steps", 1}}, R"({"sweeps": [ { "internal_force": ["all_elements"] } ]})"_json);
  ASSERT_EQ(found["failure"], "");
  EXPECT_LE(found["sum"]["max"].get<double>(), 1e-3) << found.dump(1);
  EXPECT_GT(found["total"]["mean"], 0);
}

TEST_F(Sources, AreNotRunWhereTheStudyDoesNotAskForThem) {
  write_study(nullptr);
  EXPECT_EQ(run("out").status, 0);
  EXPECT_FALSE(std::filesystem::exists(folder_.path("out/sources")));
  EXPECT_TRUE(Json::parse(read_file(folder_.path("out/results.json")))["sources"].is_null());
  const Json found = split({{"time_steps", 1}});
  for (const char* file : {"sources.md", "sources.csv", "sources.svg"})
    EXPECT_FALSE(read_file(folder_.path("out") / file).empty());
  EXPECT_THAT(read_file(folder_.path("out/report.html")), HasSubstr(found["advice"].get<std::string>()));
  write_study(nullptr);
  EXPECT_EQ(run("out").status, 0);
  EXPECT_FALSE(std::filesystem::exists(folder_.path("out/sources.md"))) << "of another study";
}

TEST_F(Sources, AreResumedAndTheSameWithMoreJobs) {
  const Json before = split({{"time_steps", 1}});
  const auto first = written("out");
  EXPECT_EQ(split({{"time_steps", 1}}), before);
  EXPECT_EQ(written("out"), first);
  std::string damaged;
  for (const auto& [file, time] : first) damaged = file;
  write_file(damaged, "no frames");
  EXPECT_EQ(split({{"time_steps", 1}}), before);
  for (const auto& [file, time] : written("out")) EXPECT_EQ(time == first.at(file), file != damaged) << file;
  EXPECT_EQ(run("two", {"--jobs", "2"}).status, 0);
  EXPECT_EQ(Json::parse(read_file(folder_.path("two/results.json")))["sources"], before);
}

TEST_F(Sources, OfABudgetAreOfTheRecommendedPoint) {
  write_study({{"time_steps", 1}},
              R"({"sweeps": [ { "basis_size": [8, 20], "internal_force": ["all_elements"] } ]})"_json);
  ASSERT_EQ(run("out", {"--budget-us", "1e9"}).status, 0);
  const Json json = Json::parse(read_file(folder_.path("out/results.json")));
  EXPECT_EQ(json["sources"]["point"], json["recommended"]);
  EXPECT_EQ(json["points"][json["recommended"].get<std::size_t>()]["modes"], 20) << "the more accurate one";
}

TEST_F(Sources, TellWhatFailed) {
  write_study(Json::object(), R"({"sweeps": [ { "basis_size": [5000] } ]})"_json);
  const Outcome outcome = run("out");
  EXPECT_EQ(outcome.status, 1);
  EXPECT_THAT(outcome.errors, HasSubstr("the sources of errors failed"));
  const Json json = Json::parse(read_file(folder_.path("out/results.json")));
  EXPECT_THAT(json["sources"]["failure"].get<std::string>(), HasSubstr("point 1: "));
  EXPECT_THAT(read_file(folder_.path("out/sources.md")), HasSubstr("/basis/size"));
}

TEST_F(Sources, AreRefusedBeforeAnythingIsRun) {
  const auto refused = [&](const Json& sources, const std::string& message) {
    write_study(sources);
    const Outcome outcome = run("out");
    EXPECT_EQ(outcome.status, 2) << message;
    EXPECT_THAT(outcome.errors, HasSubstr(message));
    EXPECT_FALSE(std::filesystem::exists(folder_.path("out")));
  };
  refused(true, "study.json: /sources: expected");
  refused({{"eigenfunction", 12}}, "did you mean \"eigenfunctions\"?");
  refused({{"time_steps", 0}}, "study.json: /sources/time_steps: expected");
  refused({{"eigenfunctions", 6}}, "study.json: /sources/eigenfunctions: expected at least 7");
  refused({{"eigenfunctions", 60}}, "study.json: /sources/eigenfunctions: expected at most 51");
  refused({{"exact_examples", "none.json"}}, "none.json");
  refused({{"exact_examples", "asset.json"}}, "study.json: /sources/exact_examples: expected an asset whose poses");
  Json scene = Json::parse(read_file(folder_.path("scene.json")));
  const Json linear = scene;
  scene["examples"]["force"] = "elastic";
  folder_.write("scene.json", scene.dump());
  refused(Json::object(), "study.json: /sources: expected a study of linear example forces");
  folder_.write("scene.json", linear.dump());
  write_exact_asset();
  Json other = Json::parse(read_file(folder_.path("exact.json")));
  other["examples"][0]["name"] = "bend";
  folder_.write("other.json", other.dump());
  refused({{"exact_examples", "other.json"}}, "study.json: /sources/exact_examples: expected an asset of the same");
  other["examples"][0]["name"] = "twist";
  write_msh(folder_.path("large.msh"), box_mesh({8, 2, 1}, {8.0, 2.0, 1.6}));
  other["object"]["mesh"] = "large.msh";
  folder_.write("other.json", other.dump());
  refused({{"exact_examples", "other.json"}}, "expected the object of the study's asset");
}

}  // namespace sources_test
}  // namespace exmat::test
