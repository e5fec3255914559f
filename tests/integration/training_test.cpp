#include <algorithm>
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <map>
#include <sstream>
#include <string>
#include <vector>

#include "common/bundle/bundle.h"
#include "tests/integration/support.h"

// Training as its users meet it: by the command line, the asset and the bundle.

namespace exmat::test {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

class Training : public testing::Test {
 protected:
  Outcome bundle(const char* basis, std::vector<std::string> options = {}) {
    // The small bar has 54 rings, too few for what many modes show.
    Json changes{{"basis", Json::parse(basis)}, {"object", {{"formulation", "linear"}}}};
    const auto asset = write_small_bar(folder_, changes);
    options.insert(options.begin(), {"bundle", asset, "-o", bundle_});
    return exmat_precompute(options);
  }
  std::filesystem::path scene(const char* members = R"({ "gravity": [0, 0, -1], "examples": { "stiffness": 50 } })") {
    return write_scene(folder_, Json::parse(members));
  }

  TemporaryFolder folder_;
  std::filesystem::path bundle_ = folder_.path("bundle.h5");
};

TEST_F(Training, OfASceneIsSaidInLogSummaryBundleAndInfo) {
  const Outcome made = bundle(R"({ "training": "auto", "training_segments": 3 })", {"--scene", scene()});
  ASSERT_EQ(made.status, 0) << made.errors;
  EXPECT_THAT(made.errors, HasSubstr("training: the loads of the scene"));
  EXPECT_THAT(made.output, HasSubstr("fidelity: "));
  const ReducedModel model = read_bundle(bundle_);
  ASSERT_TRUE(model.fidelity);
  EXPECT_EQ(model.fidelity->training_runs, 4);  // and the scene's own
  EXPECT_EQ(model.fidelity->heldout_runs, 2);
  EXPECT_LE(model.fidelity->all_elements_error, model.fidelity->modal_error);
  EXPECT_GT(model.fidelity->captured_energy, 0.9);
  const Outcome info = exmat_runtime({"info", bundle_});
  EXPECT_THAT(info.output, HasSubstr("from the full space under the loads of the scene"));
  EXPECT_THAT(info.output, HasSubstr(model.fidelity->advice));
}

// The bundle has the one of the logged selections of elements that is nearest in the held-out runs.
TEST_F(Training, JudgesCubatureByRuns) {
  const Outcome made = bundle(R"({ "training": "auto", "training_segments": 3 })",
                              {"--scene", scene(R"({ "gravity": [0, 0, -1], "examples": { "stiffness": 50 },
                                                     "internal_force": "cubature" })")});
  ASSERT_EQ(made.status, 0) << made.errors;
  const std::string before = "error in held-out runs of 4 selections ";
  const auto at = made.errors.find(before);
  ASSERT_NE(at, std::string::npos) << made.errors;
  std::istringstream said(made.errors.substr(at + before.size()));
  std::vector<double> errors(4);
  std::string percent;
  for (double& error : errors) said >> error >> percent;
  ASSERT_TRUE(said) << made.errors;
  EXPECT_GT(std::ranges::max(errors), std::ranges::min(errors)) << "the test would not notice";
  EXPECT_NEAR(100 * read_bundle(bundle_).fidelity->shape_error, std::ranges::min(errors), 0.005);  // as printed
}

TEST_F(Training, OfDeclaredLoadsNeedsNoScene) {
  const Outcome made = bundle(R"({ "training": "loads", "training_segments": 2,
      "loads": { "forces": [ { "vertices": { "ids": [0, 20] }, "force": 3 } ], "gravity": [0, 0, -2] } })");
  ASSERT_EQ(made.status, 0) << made.errors;
  EXPECT_THAT(made.errors, HasSubstr("training: the loads of the asset"));
  const FidelityData found = *read_bundle(bundle_).fidelity;
  EXPECT_EQ(found.loads, "the loads of the asset");
  EXPECT_EQ(found.heldout_runs, 4) << "all of them, and gravity, examples and forces alone";
  for (const char* text : {"; worst under ", "; tried: gravity of ", ", example forces of kappa ",
                           " N on vertices, in runs of ", " s with mass damping 0 1/s and stiffness damping ",
                           "; not tried: stiffer examples, contact, hands, stronger or weaker loads, longer runs"})
    EXPECT_THAT(found.advice, HasSubstr(text));
}

TEST_F(Training, IsLeftOutWhereTheAssetSaysSo) {
  const Outcome made = bundle(R"({ "training": "none" })", {"--scene", scene()});
  ASSERT_EQ(made.status, 0) << made.errors;
  EXPECT_THAT(made.output, Not(HasSubstr("fidelity: ")));
  EXPECT_FALSE(read_bundle(bundle_).fidelity);
}

TEST_F(Training, OfASceneThatIsNotThereIsRefused) {
  const Outcome refused = bundle(R"({ "training": "scene" })");
  EXPECT_EQ(refused.status, 2);
  EXPECT_THAT(refused.errors,
              HasSubstr("/basis/training: expected a scene, for its loads, found none; name one by --scene"));
  EXPECT_FALSE(std::filesystem::exists(bundle_));
}

TEST_F(Training, OfAVertexThatIsNotThereIsRefused) {
  const Outcome refused =
      bundle(R"({ "training": "scene" })",
             {"--scene", scene(R"({ "forces": [ { "vertices": { "ids": [99999] }, "force": [0, 0, 1] } ] })")});
  EXPECT_EQ(refused.status, 2);
  EXPECT_THAT(refused.errors, HasSubstr("/forces/0/vertices"));
  EXPECT_THAT(refused.errors, HasSubstr("99999"));
}

TEST_F(Training, EndsWithItsBudgetAndSaysSo) {
  const Outcome made = bundle(R"({ "training": "auto" })", {"--scene", scene(), "--training-budget", "0.000001"});
  EXPECT_EQ(made.status, 0) << made.errors;
  EXPECT_THAT(made.errors, HasSubstr("9 of 9 runs were left out"));
}

// Runs in many modes stand for those in full space: what a basis learns from them brings it nearer to the full space,
// which such a basis has never seen.
TEST_F(Training, InModesBringsTheBasisNearerToTheFullSpace) {
  const auto with_loads = scene(R"({ "gravity": [0, 0, -1], "examples": { "stiffness": 50, "damping": 1 },
                                     "forces": [ { "vertices": { "ids": [20] }, "force": [0, 2, 0] } ] })");
  std::map<std::string, double> errors;
  for (const std::string basis : {R"("training": "none")", R"("training": "scene", "training_space": "modes")"}) {
    const Outcome made = bundle(fmt::format(R"({{ "size": 10, {} }})", basis).c_str(), {"--scene", with_loads});
    ASSERT_EQ(made.status, 0) << made.errors;
    const ReducedModel model = read_bundle(bundle_);
    errors[basis] = error_against_full_space(with_loads, 20, 5).error;
    if (!model.fidelity) continue;
    EXPECT_THAT(made.errors, HasSubstr("in many modes"));
    EXPECT_EQ(model.fidelity->reference, "modes");
    EXPECT_EQ(model.fidelity->basis, "trained");
    EXPECT_THAT(exmat_runtime({"info", bundle_}).output, HasSubstr("from a body of many modes under the loads"));
  }
  ASSERT_EQ(errors.size(), 2U);
  for (const auto& [basis, error] : errors) fmt::print("{}: {:.2f} %\n", basis, 100 * error);
  EXPECT_LE(errors.rbegin()->second, 0.5 * errors.begin()->second);
}

TEST_F(Training, FindsTheSizeOfTheBasisByItsError) {
  const Outcome made = bundle(R"({ "training": "auto", "training_segments": 4, "size": null, "tolerance": 0.05 })",
                              {"--scene", scene()});
  ASSERT_EQ(made.status, 0) << made.errors;
  const ReducedModel model = read_bundle(bundle_);
  EXPECT_LE(model.fidelity->all_elements_error, 0.05);
}

TEST_F(Training, MakesTheSameBundleForEveryNumberOfThreads) {
  std::string first;
  for (const char* threads : {"1", "3"}) {
    const Outcome made =
        bundle(R"({ "training": "auto", "training_segments": 3 })", {"--scene", scene(), "--threads", threads});
    ASSERT_EQ(made.status, 0) << made.errors;
    if (first.empty()) first = read_file(bundle_);
    EXPECT_TRUE(read_file(bundle_) == first) << threads;
  }
}

}  // namespace
}  // namespace exmat::test
