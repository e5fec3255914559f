#include "precompute/study/sweep/study_config.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "common/core/error.h"
#include "tests/support/temporary_folder.h"

namespace exmat::precompute {
namespace {

using ::testing::HasSubstr;

TEST(StudyFile, FillsInDefaultsAndResolvesPaths) {
  const test::TemporaryFolder folder;
  const auto file = folder.write("a/study.json", R"({"name": "s", "asset": "asset.json", "scene": "../scene.json"})");
  const StudyConfig study = load_study(file);
  EXPECT_EQ(study.asset, folder.path("a/asset.json"));
  EXPECT_EQ(study.scene.lexically_normal(), folder.path("scene.json"));
  EXPECT_FALSE(study.sources) << "which takes as long as the study";
  const auto asked = folder.write("b.json", R"({"name": "s", "asset": "a", "scene": "b", "sources": {}})");
  EXPECT_EQ(load_study(asked).sources.value().time_steps, 2);
  EXPECT_FALSE(study.steps || study.reference.time_step);
  EXPECT_EQ(study.frames, 200);
  ASSERT_EQ(study.sweeps.size(), 1U) << "the files' own settings";
  EXPECT_TRUE(study.sweeps[0].basis_size.empty() && study.sweeps[0].target.empty());
  EXPECT_EQ(study.timing.rounds, 5);
}

TEST(StudyFile, ReadsTheAssetsOfSeveralBodies) {
  const test::TemporaryFolder folder;
  const StudyConfig study = load_study(folder.write(
      "study.json",
      R"({"name": "s", "scene": "b.json", "assets": [{"body": "x", "asset": "a.json"}, {"body": "y", "asset": "c.json"}]})"));
  EXPECT_TRUE(study.asset.empty());
  ASSERT_EQ(study.assets.size(), 2U);
  EXPECT_EQ(study.assets[1].body, "y");
  EXPECT_EQ(study.assets[1].asset, folder.path("c.json"));
  for (const char* text :
       {R"({"name": "s", "scene": "b.json"})",
        R"({"name": "s", "scene": "b.json", "asset": "a", "assets": [{"body": "x", "asset": "a"}]})"})
    EXPECT_THROW(load_study(folder.write("study.json", text)), InputError) << text;
}

TEST(StudyFile, ReadsEveryMember) {
  const test::TemporaryFolder folder;
  const StudyConfig study = load_study(folder.write("study.json", R"({
    "name": "s", "asset": "a.json", "scene": "b.json", "steps": 7, "frames": 3,
    "sweeps": [ {"eigenfunctions": [1, 2], "basis_size": [3], "linear_modes": [6, 7], "training": ["none", "scene"],
                 "cubature_elements": [4, 5], "material": ["corotational"],
                 "time_step": [0.01], "integrator": ["newmark"], "internal_force": ["all_elements"], "target": ["solve"], "elastic_stiffness": [0.5, 2], "precision": ["mixed"]} ],
    "reference": {"time_step": 0.002, "integrator": "bdf2"},
    "sources": {"eigenfunctions": 40, "time_steps": 4, "exact_examples": "c.json"},
    "timing": {"rounds": 2, "steps": 8} })"));
  const SweepConfig& sweep = study.sweeps.at(0);
  EXPECT_EQ(sweep.eigenfunctions, (std::vector<int>{1, 2}));
  EXPECT_EQ(sweep.linear_modes, (std::vector<int>{6, 7}));
  EXPECT_EQ(sweep.elastic_stiffness, (std::vector<double>{0.5, 2}));
  EXPECT_EQ(sweep.precision, std::vector<std::string>{"mixed"});
  EXPECT_EQ(sweep.training, (std::vector<std::string>{"none", "scene"}));
  EXPECT_EQ(sweep.cubature_elements, (std::vector<int>{4, 5}));
  EXPECT_EQ(sweep.material, std::vector<std::string>{"corotational"});
  EXPECT_EQ(sweep.time_step, std::vector<double>{0.01});
  EXPECT_EQ(sweep.internal_force, std::vector<std::string>{"all_elements"});
  EXPECT_EQ(study.steps, 7);
  EXPECT_EQ(study.reference.time_step, 0.002);
  EXPECT_EQ(study.reference.integrator, "bdf2");
  EXPECT_EQ(study.sources.value().eigenfunctions, 40);
  EXPECT_EQ(study.sources->time_steps, 4);
  EXPECT_EQ(study.sources->exact_examples, folder.path("c.json"));
  EXPECT_EQ(study.timing.steps, 8);
}

TEST(StudyFile, IsRefusedWithThePlaceAndWhatToDo) {
  const test::TemporaryFolder folder;
  const std::string head = R"({"name": "s", "asset": "a.json", "scene": "b.json", )";
  const std::pair<std::string, const char*> cases[] = {
      {R"({"name": "s", "asset": "a.json"})", "/scene: expected a string"},
      {head + R"("sweep": []})", "did you mean \"sweeps\"?"},
      {head + R"("sweeps": []})", "/sweeps: expected an array of at least 1"},
      {head + R"("sweeps": [{"basis_sise": [3]}]})",
       "/sweeps/0/basis_sise; unknown member \"basis_sise\"; did you mean \"basis_size\"?"},
      {head + R"("sweeps": [{"basis_size": 3}]})", "/sweeps/0/basis_size: expected an array"},
      {head + R"("sweeps": [{"basis_size": [0]}]})", "/sweeps/0/basis_size/0: expected an integer >= 1"},
      {head + R"("sweeps": [{"linear_modes": [0]}]})", "/sweeps/0/linear_modes/0: expected an integer >= 1"},
      {head + R"("sweeps": [{"training": ["some"]}]})", "/sweeps/0/training/0: expected"},
      {head + R"("reference": {"time_step": 0}})", "/reference/time_step: expected a number > 0"},
      {head + R"("sources": {"eigenfunctions": 1}})", "/sources/eigenfunctions: expected an integer >= 2"},
      {head + R"("sources": {"exact_example": "a.json"}})", "did you mean \"exact_examples\"?"},
      {head + R"("sweeps": [{"basis_size": [3, 3]}]})", "each element once"},
      {head + R"("sweeps": [{"internal_force": ["auto"]}]})", "\"all_elements\""},
      {head + R"("timing": {"rounds": 0}})", "/timing/rounds"}};
  for (const auto& [text, message] : cases) {
    try {
      load_study(folder.write("study.json", text));
      FAIL() << text;
    } catch (const InputError& error) {
      EXPECT_THAT(error.what(), HasSubstr(folder.path("study.json").string()));
      EXPECT_THAT(error.what(), HasSubstr(message));
    }
  }
}

}  // namespace
}  // namespace exmat::precompute
