// exmat-precompute in a build: dependencies, unchanged inputs, reports, and the installed CMake function.
#include <algorithm>
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <map>
#include <sstream>

#include "common/bundle/bundle.h"
#include "common/config/json_file.h"
#include "common/core/error.h"
#include "precompute/pipeline/depfile.h"
#include "tests/integration/support.h"
#include "tests/support/box_mesh.h"

namespace exmat::test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

constexpr int kDone = 0, kFailure = 1, kBadInput = 2;

const Json kPlain =
    Json::parse(R"({ "needs": ["examples"], "internal_force": "cubature", "basis": { "size": 6, "linear_modes": 3 },
                                     "cubature": { "elements": 6, "training_poses": 10 } })");

class BuildPipeline : public testing::Test {
 protected:
  Outcome bundle(const std::filesystem::path& asset, std::vector<std::string> options = {}) const {
    options.insert(options.begin(), {"bundle", asset, "-o", bundle_});
    return exmat_precompute(options);
  }
  Json report() const {
    const Json report = Json::parse(read_file(report_));
    EXPECT_NO_THROW(check_against_schema(report, "report", report_));
    return report;
  }

  TemporaryFolder folder_;
  std::filesystem::path bundle_ = folder_.path("bundle.h5"), report_ = folder_.path("report.json"),
                        depfile_ = folder_.path("bundle.d");
};

// Ninja itself reads the names back: what is missing has no rule to make it.
TEST_F(BuildPipeline, NinjaReadsTheDepfile) {
  const std::vector<std::string> names{"plain.veg",       "two words.veg",    "a#b$c.veg",       "colon:d.veg",
                                       "back\\slash.veg", "back\\ slash.veg", "tre\xcc\x81s.veg"};
  std::vector<std::filesystem::path> files;
  for (const std::string& name : names) files.push_back(folder_.write("in/" + name, "x"));
  files.push_back(files.front());
  const std::filesystem::path target = folder_ / "out put.h5";
  folder_.write("made.d", precompute::depfile_text(target, files));
  std::string escaped = target.string();
  escaped.insert(escaped.find(' '), "$");
  folder_.write("build.ninja",
                fmt::format("rule make\n  command = touch '{}' && cp made.d '{}.d'\n  depfile = {}.d\nbuild {}: make\n",
                            target.string(), target.string(), escaped, escaped));
  const auto ninja = [&] { return execute("ninja", {"-C", folder_.path()}).output; };
  EXPECT_THAT(ninja(), HasSubstr("[1/1]"));
  EXPECT_THAT(ninja(), HasSubstr("no work to do"));
  for (const auto& file : files) {
    std::filesystem::last_write_time(file, std::filesystem::file_time_type::clock::now());
    EXPECT_THAT(ninja(), HasSubstr("[1/1]")) << file;
    EXPECT_THAT(ninja(), HasSubstr("no work to do")) << file;
  }
}

TEST_F(BuildPipeline, NoDepfileHoldsALineEnd) {
  for (const char* name : {"a\nb.veg", "a\rb.veg"}) {
    EXPECT_THROW(precompute::depfile_text("a.h5", {name}), InputError);
    EXPECT_THROW(precompute::depfile_text(name, {"a.veg"}), InputError);
  }
}

TEST_F(BuildPipeline, TheDepfileNamesEveryFileThatWasRead) {
  // The bar's mesh in a file of its own, included by another; fixed vertices by a file.
  const auto asset = write_small_bar(folder_, Json::parse(R"({ "object": { "mesh": "bar.veg", "fixed": null } })"));
  folder_.write("part.veg", "*VERTICES\n4 3\n1 0 0 0\n2 1 0 0\n3 0 1 0\n4 0 0 1\n");
  folder_.write("bar.veg", "*INCLUDE part.veg\n*ELEMENTS\nTET\n1 4\n1 1 2 3 4\n");
  folder_.write("fixed.bou", "1, 2, 3\n");
  folder_.write("bar.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
  Json json = Json::parse(read_file(asset));
  json["object"]["fixed"] = {{"file", "fixed.bou"}};
  json["object"]["render_mesh"] = "bar.obj";
  json["examples"] = Json::array();
  json["basis"] = {{"size", 2}, {"linear_modes", 2}};
  json["cubature"] = {{"elements", 1}, {"training_poses", 10}};
  folder_.write("asset.json", json.dump());
  const auto scene = write_scene(folder_, Json::parse(R"({ "output": { "render": true } })"));
  const Outcome outcome = bundle(asset, {"--scene", scene, "--depfile", depfile_});
  ASSERT_EQ(outcome.status, kDone) << outcome.errors;
  std::istringstream stream(read_file(depfile_));
  std::set<std::string> words;
  for (std::string word; stream >> word;) words.insert(word);
  std::set<std::string> expected{bundle_.string() + ":", "\\"};
  for (const char* name : {"asset.json", "bar.veg", "part.veg", "fixed.bou", "bar.obj", "scene.json"})
    expected.insert(folder_.path(name));
  EXPECT_EQ(words, expected);
}

TEST_F(BuildPipeline, UnchangedInputsAreLeftAlone) {
  const auto asset = write_small_bar(folder_, kPlain);
  ASSERT_EQ(bundle(asset, {"--if-changed"}).status, kDone);
  const auto time = std::filesystem::last_write_time(bundle_);
  const auto is_left_alone = [&](const std::vector<std::string>& options) {
    std::filesystem::last_write_time(bundle_, time);
    const Outcome outcome = bundle(asset, options);
    EXPECT_EQ(outcome.status, kDone) << outcome.errors;
    const bool left = std::filesystem::last_write_time(bundle_) == time;
    EXPECT_EQ(left, outcome.errors.find("have not changed, nothing to do") != std::string::npos) << outcome.errors;
    EXPECT_EQ(left, outcome.output.empty());
    return left;
  };
  EXPECT_TRUE(is_left_alone({"--if-changed", "--depfile", depfile_, "--report", report_}));
  EXPECT_THAT(read_file(depfile_), HasSubstr("twist.msh"));
  EXPECT_EQ(report()["status"], "unchanged");
  EXPECT_EQ(report()["bundle"]["input_sha256"], summarise_bundle(bundle_).input_sha256);
  EXPECT_FALSE(is_left_alone({}));
  // Another need, another file, a bundle that is none.
  const auto scene = write_scene(folder_);
  EXPECT_FALSE(is_left_alone({"--if-changed", "--scene", scene}));
  EXPECT_TRUE(is_left_alone({"--if-changed", "--scene", scene}));
  EXPECT_FALSE(is_left_alone({"--if-changed"}));
  folder_.write("twist.msh", read_file(folder_ / "twist.msh") + "$Comments\n$EndComments\n");
  EXPECT_FALSE(is_left_alone({"--if-changed"}));
  EXPECT_TRUE(is_left_alone({"--if-changed"}));
  folder_.write("bundle.h5", read_file(bundle_).substr(0, 5000));
  EXPECT_FALSE(is_left_alone({"--if-changed"}));
  EXPECT_TRUE(is_left_alone({"--if-changed"}));
  // Bad input is refused, and the bundle stays.
  folder_.write("twist.msh", "none");
  EXPECT_EQ(bundle(asset, {"--if-changed"}).status, kBadInput);
  EXPECT_NO_THROW(read_bundle(bundle_));
}

TEST_F(BuildPipeline, TheReportSaysWhatCameOut) {
  // Inverted on purpose: the log warns of it.
  const auto asset = write_small_bar(folder_);
  std::string mesh = read_file(folder_ / "bar.msh");
  const std::size_t row = mesh.find("\n1 4 2 1 1 ") + 11;
  std::swap(mesh[row], mesh[row + 2]);
  folder_.write("bar.msh", mesh);
  const Outcome outcome = bundle(asset, {"--report", report_});
  ASSERT_EQ(outcome.status, kDone) << outcome.errors;
  const Json found = report();
  const ReducedModel model = read_bundle(bundle_);
  EXPECT_EQ(found["status"], "done");
  EXPECT_EQ(found["exit_status"], 0);
  EXPECT_EQ(found["message"], "");
  EXPECT_EQ(found["bundle"]["input_sha256"], model.input_sha256);
  EXPECT_EQ(found["bundle"]["bytes"], std::filesystem::file_size(bundle_));
  // As another program hashes them.
  const auto sha256 = [](const std::filesystem::path& file) {
    return execute("sha256sum", {file}).output.substr(0, 64);
  };
  EXPECT_EQ(found["bundle"]["sha256"], sha256(bundle_));
  ASSERT_EQ(found["inputs"].size(), 4U);
  for (const Json& input : found["inputs"]) EXPECT_EQ(input["sha256"], sha256(input["file"])) << input;
  ASSERT_EQ(found["warnings"].size(), 3U) << outcome.errors;
  EXPECT_THAT(found["warnings"][0], HasSubstr("re-oriented 1 inverted tets"));
  EXPECT_THAT(found["warnings"][2], HasSubstr("example twist: settled at best"));
  for (const std::string warning : found["warnings"]) EXPECT_THAT(outcome.errors, HasSubstr("[warning] " + warning));
  ASSERT_EQ(found["examples"].size(), 2U);
  EXPECT_EQ(found["examples"][1]["name"], "twist");
  EXPECT_EQ(found["examples"][1]["basis_error"], model.examples->examples[1].basis_error);
  EXPECT_EQ(found["examples"][1]["settled_error"], model.examples->examples[1].settled_error);
  EXPECT_EQ(found["mesh_stiffness"]["ratio"], model.object->stiffness_ratio);
  EXPECT_EQ(found["cubature"]["heldout_error"], model.cubature->heldout_error);
  EXPECT_EQ(found["targets"][0]["error"], model.targets->error);
  EXPECT_EQ(found["sizes"]["tets"], 96);
  EXPECT_EQ(found["groups"].size(), 17U) << found["groups"];
  double seconds = 0;
  std::int64_t peak = 1 << 20;
  std::set<std::string> stages;
  for (const Json& stage : found["stages"]) {
    seconds += stage["seconds"].get<double>();
    EXPECT_GE(stage["peak_memory_bytes"].get<std::int64_t>(), peak) << stage;
    peak = stage["peak_memory_bytes"];
    stages.insert(stage["stage"]);
  }
  EXPECT_GT(seconds, 0);
  EXPECT_LT(peak, std::int64_t{1} << 33);
  for (const char* stage : {"reading the object", "reading the examples", "shape space and examples", "linear modes",
                            "cubature", "targets", "contact", "writing the bundle"})
    EXPECT_TRUE(stages.contains(stage)) << stage;
}

TEST_F(BuildPipeline, TheReportIsWrittenOfAFailure) {
  const auto asset = write_small_bar(folder_);
  folder_.write("twist.msh", "none");
  const Outcome refused = bundle(asset, {"--report", report_, "--log-level", "error"});
  EXPECT_EQ(refused.status, kBadInput);
  Json found = report();
  EXPECT_EQ(found["status"], "failed");
  EXPECT_EQ(found["exit_status"], kBadInput);
  EXPECT_EQ("exmat-precompute: " + found["message"].get<std::string>() + "\n", refused.errors);
  EXPECT_EQ(found["stages"].size(), 1U) << "the object was read";
  EXPECT_THAT(found["bundle"], ::testing::SizeIs(1));
  // Not even an asset.
  EXPECT_EQ(bundle(folder_ / "none.json", {"--report", report_}).status, kBadInput);
  EXPECT_THAT(report()["message"], HasSubstr("none.json"));
  // No place for the bundle or for the report: known before the work.
  const Outcome failed = exmat_precompute({"bundle", asset, "-o", folder_ / "no/folder.h5", "--report", report_});
  EXPECT_EQ(failed.status, kBadInput);
  EXPECT_EQ(report()["exit_status"], kBadInput);
  const Outcome nowhere = bundle(asset, {"--report", folder_ / "no/report.json"});
  EXPECT_EQ(nowhere.status, kBadInput);
  EXPECT_THAT(nowhere.errors, HasSubstr("no/report.json"));
  EXPECT_FALSE(std::filesystem::exists(bundle_));
}

TEST_F(BuildPipeline, ProgressInJsonCoversTheStages) {
  const Outcome outcome =
      bundle(write_small_bar(folder_, kPlain), {"--progress", "json", "--log-level", "error", "--report", report_});
  ASSERT_EQ(outcome.status, kDone);
  std::istringstream lines(outcome.errors);
  std::set<std::string> begun, ended;
  for (std::string line; std::getline(lines, line);) {
    const Json progress = Json::parse(line);
    (progress["finished"].get<bool>() ? ended : begun).insert(progress["stage"]);
  }
  const Json stages = report()["stages"];
  for (const Json& stage : stages) {
    EXPECT_TRUE(begun.contains(stage["stage"])) << stage;
    EXPECT_TRUE(ended.contains(stage["stage"])) << stage;
  }
}

// A cache never changes a bundle, and what a change does not touch comes from it.
TEST_F(BuildPipeline, TheCacheServesWhatDidNotChange) {
  const auto changed = [&](const char* changes) {
    Json all = kPlain;
    all.merge_patch(Json::parse(R"({ "internal_force": "polynomial", "needs": ["examples", "targets"],
                                        "basis": { "training": "auto", "training_segments": 2 } })"));
    all.merge_patch(Json::parse(changes));
    return write_small_bar(folder_, all);
  };
  // The stages that were computed, of all that were asked for.
  std::map<std::string, std::string> plain;  // bundles of each asset without a cache
  const auto computed = [&](const std::filesystem::path& asset) {
    std::string& expected = plain[read_file(asset)];
    if (expected.empty()) {
      EXPECT_EQ(bundle(asset).status, kDone);
      expected = read_file(bundle_);
    }
    const Outcome outcome = bundle(asset, {"--cache", folder_ / "cache", "--report", report_});
    EXPECT_EQ(outcome.status, kDone) << outcome.errors;
    EXPECT_TRUE(read_file(bundle_) == expected) << "other bytes";
    std::set<std::string> stages;
    const Json uses = report()["cache"];
    EXPECT_GE(uses.size(), 7U);
    for (const Json& use : uses)
      if (!use["found"].get<bool>()) stages.insert(use["stage"]);
    return stages;
  };
  using Stages = std::set<std::string>;
  const Stages all{"eigenfunctions",
                   "eigenfunctions of the rest example",
                   "linear modes",
                   "modal derivatives",
                   "cubature",
                   "polynomial",
                   "targets",
                   "training",
                   "stiffness of the mesh"};
  EXPECT_EQ(computed(changed("{}")), all);
  EXPECT_EQ(computed(changed("{}")), Stages{});
  EXPECT_EQ(computed(changed(R"({ "cubature": { "elements": 7 } })")), Stages{"cubature"});
  // Other weights, of the same poses: the runs differ.
  const char* const unweighted = R"({ "shape_space": { "weighting": "none" } })";
  EXPECT_TRUE(computed(changed(unweighted)).contains("training"));
  // Another example, whose field is in the basis: on a mesh of its own, which is aligned.
  TetMesh bent = box_mesh({7, 3, 2}, BarFiles{}.lengths);
  bent.vertices = twisted(bent.vertices, {.twist = 0, .bend = 0.5});
  write_msh(folder_ / "bent.msh", bent);
  const char* const more = R"({ "alignment": { "accept": true }, "examples": [
      { "name": "rest", "mesh": "rest.msh", "rest": true }, { "name": "twist", "mesh": "twist.msh" },
      { "name": "bent", "mesh": "bent.msh" } ] })";
  EXPECT_EQ(computed(changed(more)), (Stages{"alignment of bent", "cubature", "polynomial", "targets", "training"}));
  EXPECT_EQ(computed(changed(more)), Stages{});
  // One damaged file: its stage alone is computed again, to the same bundle.
  std::size_t damaged = 0;
  for (const auto& entry : std::filesystem::directory_iterator(folder_ / "cache")) {
    std::string bytes = read_file(entry.path());
    bytes[bytes.size() / 2] = static_cast<char>(bytes[bytes.size() / 2] ^ 4);
    if (damaged++ == 0) write_file(entry.path(), bytes);
  }
  const auto again = computed(changed("{}")), and_more = computed(changed(more));
  const auto fewer = computed(changed(R"({ "cubature": { "elements": 7 } })")), other = computed(changed(unweighted));
  EXPECT_EQ(again.size() + and_more.size() + fewer.size() + other.size(), 1U);
}

// The installed package, in the two kinds of build that read depfiles.
class BundlePackage : public BuildPipeline, public testing::WithParamInterface<const char*> {
 protected:
  void SetUp() override {
    for (const char* component : {"runtime", "precompute"})
      must_run(EXMAT_CMAKE, {"--install", EXMAT_BINARY_DIR, "--component", component, "--prefix", prefix_});
    std::filesystem::copy(std::filesystem::path(EXMAT_SOURCE_DIR) / "tests/integration/bundle_project", sources_,
                          std::filesystem::copy_options::recursive);
    std::filesystem::create_directory(assets_);
    const TemporaryFolder written;
    write_small_bar(written, kPlain);
    std::filesystem::copy(written.path(), assets_);
    folder_.write("project/scene.json", R"({ "bundle": "plain.h5" })");
  }
  static std::string must_run(const std::string& program, const std::vector<std::string>& arguments) {
    const Outcome outcome = execute(program, arguments);
    EXPECT_EQ(outcome.status, kDone) << outcome.output << outcome.errors;
    return outcome.output;
  }
  // Builds; returns how many bundles were computed.
  std::ptrdiff_t build() {
    const std::string output = must_run(EXMAT_CMAKE, {"--build", build_});
    std::ptrdiff_t count = 0;
    for (std::size_t at = 0; (at = output.find("Computing the bundle", at)) != std::string::npos; ++at) ++count;
    return count;
  }
  // Later than any output so far.
  void touch(const std::string& name) {
    std::filesystem::last_write_time(assets_ / name, std::filesystem::file_time_type::clock::now());
  }

  std::filesystem::path prefix_ = folder_ / "installed", sources_ = folder_ / "project", build_ = folder_ / "build",
                        assets_ = sources_ / "assets of the bar";
};

TEST_P(BundlePackage, ComputesWhatChangedAndNothingElse) {
  must_run(EXMAT_CMAKE, {"-G", GetParam(), "-S", sources_, "-B", build_, "-DCMAKE_PREFIX_PATH=" + prefix_.string()});
  EXPECT_EQ(build(), 2);
  const auto plain = build_ / "for the scene/plain.h5";
  EXPECT_EQ(read_file(build_ / "where.txt"), plain.string());
  EXPECT_TRUE(read_bundle(build_ / "bar.h5").examples);
  EXPECT_FALSE(read_bundle(plain).examples);
  EXPECT_EQ(Json::parse(read_file(build_ / "bar.report.json"))["cache"].size(), 7U)
      << "the working folder is the binary folder";
  EXPECT_EQ(build(), 0);
  touch("twist.msh");
  EXPECT_EQ(build(), 1) << "the other has no examples";
  EXPECT_EQ(build(), 0);
  touch("bar.msh");
  EXPECT_EQ(build(), 2);
  EXPECT_EQ(build(), 0);
}

TEST_F(BuildPipeline, ThePackageSaysWhereTheProgramIsMissing) {
  const auto prefix = folder_ / "installed", sources = folder_ / "project";
  ASSERT_EQ(execute(EXMAT_CMAKE, {"--install", EXMAT_BINARY_DIR, "--component", "runtime", "--prefix", prefix}).status,
            kDone);
  folder_.write("project/CMakeLists.txt",
                "cmake_minimum_required(VERSION 3.25)\nproject(bundles LANGUAGES NONE)\nfind_package(exmat REQUIRED)\n"
                "set(CMAKE_FIND_USE_SYSTEM_ENVIRONMENT_PATH OFF)\nset(CMAKE_FIND_USE_CMAKE_SYSTEM_PATH OFF)\n"
                "exmat_add_bundle(bar asset.json)\n");
  const Outcome outcome =
      execute(EXMAT_CMAKE, {"-S", sources, "-B", folder_ / "build", "-DCMAKE_PREFIX_PATH=" + prefix.string()});
  EXPECT_EQ(outcome.status, 1);
  EXPECT_THAT(outcome.errors, HasSubstr("there is no exmat-precompute"));
}

INSTANTIATE_TEST_SUITE_P(Of, BundlePackage, testing::Values("Ninja", "Unix Makefiles"),
                         [](const auto& param) { return param.index == 0 ? "Ninja" : "Make"; });

}  // namespace
}  // namespace exmat::test
