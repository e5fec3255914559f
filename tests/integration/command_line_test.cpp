#include <cstring>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "common/bundle/bundle.h"
#include "common/mesh/tet_mesh.h"
#include "tests/integration/support.h"
#include "tests/support/box_mesh.h"

namespace exmat::test {
namespace command_line_test {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::StartsWith;

constexpr int kDone = 0, kBadInput = 2;

std::vector<std::string> lines(const std::string& text) {
  std::vector<std::string> lines;
  for (std::size_t begin = 0, end = 0; begin < text.size(); begin = end + 1) {
    end = std::min(text.find('\n', begin), text.size());
    lines.push_back(text.substr(begin, end - begin));
  }
  return lines;
}

/// One line on stderr, which names all of these; nothing on stdout.
void expect_refused(const Outcome& outcome, int status, const std::vector<std::string>& named) {
  EXPECT_EQ(outcome.status, status);
  EXPECT_EQ(lines(outcome.errors).size(), 1U) << outcome.errors;
  EXPECT_THAT(outcome.errors, StartsWith("exmat-"));
  for (const std::string& text : named) EXPECT_THAT(outcome.errors, HasSubstr(text));
  EXPECT_THAT(outcome.output, IsEmpty());
}

/// A folder with the small bar. Commands log errors only.
class CommandLine : public testing::Test {
 protected:
  Outcome bundle(const std::filesystem::path& asset, const std::filesystem::path& output) {
    return exmat_precompute({"bundle", asset, "-o", output, "--log-level", "error"});
  }
  Outcome run(const std::filesystem::path& scene, std::vector<std::string> options = {}) {
    options.insert(options.begin(), {"run", scene, "--log-level", "error"});
    return exmat_runtime(options);
  }
  void make_bundle(const Json& changes = Json::object()) {
    const Outcome outcome = bundle(write_small_bar(folder_, changes), bundle_);
    ASSERT_EQ(outcome.status, kDone) << outcome.errors;
  }

  /// Refused, without a trace but the message: neither an output nor a temporary file, an older output as it was.
  void expect_refused_cleanly(const std::filesystem::path& asset, const std::vector<std::string>& named) {
    SCOPED_TRACE(read_file(asset));
    const auto before = folder_.names();
    expect_refused(bundle(asset, bundle_), kBadInput, named);
    EXPECT_EQ(folder_.names(), before);
    const auto older = folder_.write("older.h5", "an older output");
    expect_refused(bundle(asset, older), kBadInput, named);
    EXPECT_EQ(read_file(older), "an older output");
    std::filesystem::remove(older);
    EXPECT_EQ(folder_.names(), before);
  }

  void expect_asset_refused(const char* changes, const std::vector<std::string>& named) {
    expect_refused_cleanly(write_small_bar(folder_, Json::parse(changes)), named);
  }

  void expect_scene_refused(const char* members, const std::vector<std::string>& named) {
    SCOPED_TRACE(members);
    const auto scene = write_scene(folder_, Json::parse(members));
    const auto before = folder_.names();
    expect_refused(run(scene, {"-o", folder_.path("t.h5")}), kBadInput, named);
    EXPECT_EQ(folder_.names(), before);
  }

  TemporaryFolder folder_;
  std::filesystem::path bundle_ = folder_.path("bundle.h5");
};

TEST_F(CommandLine, HelpAndVersionGoToStdout) {
  for (const auto& program : {exmat_precompute, exmat_runtime}) {
    const Outcome help = program({"--help"}), version = program({"--version"});
    EXPECT_EQ(help.status, kDone);
    EXPECT_THAT(help.output, HasSubstr("Usage"));
    EXPECT_EQ(version.status, kDone);
    EXPECT_THAT(version.output, ::testing::ContainsRegex("exmat.* [0-9]+\\.[0-9]+\\.[0-9]+"));
    EXPECT_EQ(lines(version.output).size(), 1U);
    EXPECT_THAT(help.errors + version.errors, IsEmpty());
  }
}

TEST_F(CommandLine, BadUsageIsRefused) {
  for (const auto& program : {exmat_precompute, exmat_runtime})
    for (const std::vector<std::string>& arguments : std::vector<std::vector<std::string>>{{}, {"no-such-command"}}) {
      const Outcome outcome = program(arguments);
      EXPECT_EQ(outcome.status, kBadInput);
      EXPECT_THAT(outcome.errors, HasSubstr("--help"));
      EXPECT_THAT(outcome.output, IsEmpty());
    }
  const auto asset = write_small_bar(folder_);
  const auto complains_of = [](const Outcome& outcome, const char* text) {
    EXPECT_EQ(outcome.status, kBadInput);
    EXPECT_THAT(outcome.errors, HasSubstr(text));
    EXPECT_THAT(outcome.output, IsEmpty());
  };
  complains_of(exmat_precompute({"bundle", asset, "-o", bundle_, "--no-such-option"}), "--no-such-option");
  complains_of(exmat_precompute({"bundle", asset}), "--output");
  complains_of(exmat_precompute({"bundle", asset, "-o", bundle_, "--threads", "many"}), "--threads");
  complains_of(exmat_precompute({"bundle", asset, "-o", bundle_, "--log-level", "loud"}), "--log-level");
  complains_of(exmat_runtime({"run", asset, "--steps", "0"}), "--steps");
  EXPECT_FALSE(std::filesystem::exists(bundle_));
}

TEST_F(CommandLine, FilesThatAreNoneAreNamed) {
  const auto none = folder_.path("none.json").string();
  expect_refused(bundle(none, bundle_), kBadInput, {none, "no such file"});
  expect_refused(bundle(folder_.path(""), bundle_), kBadInput, {folder_.path("").string(), "folder"});
  expect_refused(run(none), kBadInput, {none, "no such file"});
  expect_refused(exmat_runtime({"info", none}), kBadInput, {none, "no such file"});
  const auto asset = write_small_bar(folder_);
  expect_refused(exmat_precompute({"bundle", asset, "-o", bundle_, "--scene", none}), kBadInput,
                 {none, "no such file"});
  expect_refused(exmat_runtime({"info", asset}), kBadInput, {asset, "HDF5"});
}

TEST_F(CommandLine, OutputsThatCannotBeWrittenAreNamed) {
  const auto asset = write_small_bar(folder_);
  const auto before = folder_.names();
  const std::string missing = folder_.path("missing/bundle.h5"), folder = folder_.path("");
  expect_refused(bundle(asset, folder), kBadInput, {folder, "folder"});
  expect_refused(bundle(asset, missing), kBadInput, {missing, "no folder"});
  EXPECT_EQ(folder_.names(), before);

  make_bundle();
  const auto scene = write_scene(folder_, {{"steps", 5}});
  const auto with_bundle = folder_.names();
  expect_refused(run(scene, {"-o", folder}), kBadInput, {folder, "folder"});
  expect_refused(run(scene, {"-o", missing}), kBadInput, {missing, "no folder"});
  EXPECT_EQ(folder_.names(), with_bundle);
}

TEST_F(CommandLine, FaultsOfAnAssetAreNamed) {
  const std::string asset = write_small_bar(folder_);
  expect_refused_cleanly(folder_.write("asset.json", "{ \"name\": \"bar\",\n  oops"), {asset, "line 2"});
  expect_asset_refused(R"({ "basis": { "siz": 3 } })", {asset, "/basis/siz", "did you mean \"size\"?"});
  expect_asset_refused(R"({ "object": { "mesh": "none.msh" } })", {folder_.path("none.msh"), "no such file"});
  expect_asset_refused(R"({ "object": { "mesh": "asset.json" } })", {asset, ".msh", "'.json'"});
}

TEST_F(CommandLine, FaultsOfAClampAreNamed) {
  const std::string asset = folder_.path("asset.json");
  const auto expect_clamp_refused = [&](const char* fixed, const std::vector<std::string>& named) {
    auto changes = Json::parse(R"({ "object": { "fixed": { "box": null } } })");
    changes["object"]["fixed"].update(Json::parse(fixed));
    expect_asset_refused(changes.dump().c_str(), named);
  };
  expect_clamp_refused(R"({ "sphere": { "center": [9, 9, 9], "radius": 1 } })",
                       {asset, "sphere", "at least one vertex", "the mesh lies in"});
  // An edge of the bar's end: a hinge.
  expect_clamp_refused(R"({ "ids": [0, 9, 18] })", {asset, "/object/fixed", "not on one line", "found 3"});
  expect_clamp_refused(R"({ "ids": [0, 9, 5400] })", {asset, "ids", "below 54", "found 5400"});
  expect_clamp_refused(R"({ "sphere": { "center": [0, 0, 0], "radius": 99 } })",
                       {asset, "/object/fixed", "found all of them fixed"});
  expect_clamp_refused(R"({ "file": "none.bou" })", {folder_.path("none.bou"), "no such file"});
}

TEST_F(CommandLine, SizesThatTheMeshCannotGiveAreNamed) {
  const std::string asset = folder_.path("asset.json");
  expect_asset_refused(R"({ "cubature": { "elements": 97 } })",
                       {asset, "/cubature/elements", "the number of elements of the mesh, 54", "found 97"});
  expect_asset_refused(R"({ "cubature": { "elements": null, "tolerance": 0.1, "method": "nn_htp" } })",
                       {asset, "/cubature/tolerance", "nn_htp"});
  expect_asset_refused(R"({ "shape_space": { "eigenfunctions": 52 } })",
                       {asset, "/shape_space/eigenfunctions", "at most 51", "54 vertices", "found 52"});
  expect_asset_refused(R"({ "basis": { "size": 100 } })", {asset, "/basis/size", "at most 21", "found 100"});
  expect_asset_refused(R"({ "basis": { "linear_modes": 144 } })",
                       {asset, "/basis/linear_modes", "at most 143", "found 144"});
}

TEST_F(CommandLine, FaultsOfASceneAreNamed) {
  const std::string scene = folder_.path("scene.json"), bundle = bundle_;
  make_bundle(Json::parse(R"({ "needs": [] })"));
  expect_scene_refused(R"({ "gravty": [0, 0, -1] })", {scene, "/gravty", "did you mean \"gravity\"?"});
  expect_scene_refused(R"({ "bundle": "none.h5" })", {folder_.path("none.h5"), "no such file"});
  expect_scene_refused(R"({ "examples": { "stiffness": 10 } })", {bundle, "/examples"});
  expect_scene_refused(R"({ "forces": [ { "vertices": { "ids": [54] }, "force": [0, 0, 1] } ] })",
                       {scene, "/forces/0/vertices", "0 to 53", "found 54"});
  expect_scene_refused(R"({ "body": { "position": [0, 0, 1] } })",
                       {"scene.json", "/body/position", "the bundle's body has fixed vertices"});
}

TEST_F(CommandLine, CheckReadsTheInputsAndWritesNothing) {
  const auto asset = write_small_bar(folder_);
  const auto before = folder_.names();
  const Outcome sound = exmat_precompute({"check", asset});
  EXPECT_EQ(sound.status, kDone);
  EXPECT_THAT(sound.output, AllOf(HasSubstr(asset.string()), HasSubstr("sound")));
  EXPECT_THAT(sound.errors, HasSubstr("[info]"));
  EXPECT_EQ(folder_.names(), before);

  TetMesh flat = box_mesh({1, 1, 1}, {1, 1, 1});
  flat.vertices.row(7) = flat.vertices.row(3);
  write_msh(folder_.path("bar.msh"), flat);
  expect_refused(exmat_precompute({"check", asset, "--log-level", "error"}), kBadInput, {folder_.path("bar.msh")});
}

TEST_F(CommandLine, ResultsGoToStdoutAndLogsToStderr) {
  const auto asset = write_small_bar(folder_);
  const Outcome loud = exmat_precompute({"bundle", asset, "-o", bundle_});
  EXPECT_EQ(loud.status, kDone);
  EXPECT_THAT(loud.output, AllOf(HasSubstr(bundle_.string()), HasSubstr("r = 8, s = 12, m = 6"),
                                 ::testing::Not(HasSubstr("[info]"))));
  EXPECT_THAT(loud.errors, HasSubstr("[info]"));
  const Outcome quiet = bundle(asset, bundle_);
  EXPECT_EQ(quiet.status, kDone);
  EXPECT_THAT(quiet.errors, IsEmpty());
  const Outcome info = exmat_runtime({"info", bundle_});
  EXPECT_EQ(info.status, kDone);
  EXPECT_THAT(info.output, AllOf(HasSubstr("54 vertices, 96 tets"), HasSubstr("twist")));
  EXPECT_THAT(info.errors, IsEmpty());
}

TEST_F(CommandLine, RunTakesItsStepsAndOutputFromTheOptions) {
  make_bundle();
  const auto scene = write_scene(folder_, Json::parse(R"({ "gravity": [0, 0, -1], "examples": { "stiffness": 10 },
                                                          "output": { "trajectory": "named.h5", "every": 1 } })"));
  const Outcome loud = exmat_runtime({"run", scene, "--steps", "5", "-o", folder_.path("t.h5")});
  EXPECT_EQ(loud.status, kDone);
  EXPECT_THAT(loud.output, AllOf(::testing::ContainsRegex("steps +5\n"), HasSubstr(folder_.path("t.h5").string())));
  EXPECT_THAT(loud.errors, AllOf(HasSubstr("[info]"), HasSubstr("plan: ")));
  const auto names = folder_.names();
  EXPECT_TRUE(names.contains("t.h5") && names.contains("t.xdmf") && !names.contains("named.h5"));
  EXPECT_THAT(run(scene, {"--steps", "5"}).errors, IsEmpty());
  EXPECT_TRUE(folder_.names().contains("named.h5"));
}

TEST_F(CommandLine, ProgressInJsonIsOneObjectALine) {
  const auto asset = write_small_bar(folder_);
  const std::vector<std::string> common{"--progress", "json", "--log-level", "error"};
  std::vector<std::string> arguments{"bundle", asset, "-o", bundle_};
  arguments.insert(arguments.end(), common.begin(), common.end());
  std::vector<std::string> reports = lines(exmat_precompute(arguments).errors);
  arguments = {"run", write_scene(folder_), "--steps", "5"};
  arguments.insert(arguments.end(), common.begin(), common.end());
  for (const std::string& line : lines(exmat_runtime(arguments).errors)) reports.push_back(line);
  ASSERT_GE(reports.size(), 2U);
  for (const std::string& line : reports) {
    const Json report = Json::parse(line, nullptr, /*allow_exceptions=*/false);
    ASSERT_TRUE(report.is_object()) << line;
    for (const char* member : {"stage", "done", "total", "elapsed_seconds", "finished"})
      EXPECT_TRUE(report.contains(member)) << line;
  }
}

TEST_F(CommandLine, ADamagedBundleIsRefusedByNameOfTheDataset) {
  make_bundle();
  EXPECT_EQ(exmat_runtime({"validate", bundle_}).status, kDone);

  const Eigen::VectorXd weights = read_bundle(bundle_).cubature->weights;
  std::string bytes = read_file(bundle_);
  const std::string first_two(reinterpret_cast<const char*>(weights.data()), 2 * sizeof(double));
  const std::size_t place = bytes.find(first_two);
  ASSERT_NE(place, std::string::npos);
  bytes[place] = static_cast<char>(bytes[place] ^ 1);
  folder_.write("bundle.h5", bytes);

  const Outcome outcome = exmat_runtime({"validate", bundle_});
  EXPECT_EQ(outcome.status, kBadInput);
  EXPECT_THAT(outcome.output, HasSubstr("/cubature/weights"));
  EXPECT_THAT(outcome.errors, HasSubstr(bundle_.string()));
  expect_refused(run(write_scene(folder_)), kBadInput, {bundle_, "/cubature/weights"});
}

}  // namespace command_line_test
}  // namespace exmat::test
