#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "common/bundle/bundle.h"
#include "common/core/error.h"
#include "tests/common/bundle/small_model.h"
#include "tests/common/bundle/spoiler.h"

namespace exmat {
namespace {

using test::small_model;
using test::Spoiler;
using test::TemporaryFolder;
using ::testing::HasSubstr;

// Before version 6 `doubt` had another name.
void name_doubt_as_before(Spoiler& spoiler, const std::string& folder, const ExampleSet& set) {
  for (const ExampleData& example : set.examples)
    spoiler.rename_attribute((folder + "/" + example.name).c_str(), "doubt", "confidence");
}

// small_model(false) as version 5 wrote it.
void write_version_5(const std::filesystem::path& path) {
  ReducedModel model = small_model(false);
  model.fidelity.reset();
  model.target_space.reset();
  model.target_elasticity.reset();
  for (RegionData& region : model.regions) {
    region.target_space.reset();
    region.target_elasticity.reset();
  }
  write_bundle(model, path);
  Spoiler spoiler(path);
  spoiler.set_integer("/", "format_version", 5);
  spoiler.remove_attribute("/targets", "is_pull");
  spoiler.remove_attribute("/regions/left/targets", "is_pull");
  name_doubt_as_before(spoiler, "/examples", *model.examples);
  for (const RegionData& region : model.regions)
    name_doubt_as_before(spoiler, "/regions/" + region.name + "/examples", region.examples);
}

TEST(BundleOfVersion5, HasTheDoubtUnderItsFormerName) {
  const TemporaryFolder folder;
  write_version_5(folder / "a.h5");
  const ReducedModel model = read_bundle(folder / "a.h5");
  for (const ExampleData& example : model.examples->examples) EXPECT_EQ(example.doubt, 0.25);
  ASSERT_EQ(model.regions.size(), 2U);
  EXPECT_EQ(model.regions.back().examples.examples.back().doubt, 0.25);
  EXPECT_FALSE(model.targets->is_pull || model.regions.front().targets->is_pull);
  EXPECT_THAT(validate_bundle(folder / "a.h5"), ::testing::IsEmpty());
}

TEST(BundleOfVersion5, IsRefusedByThatNameWhereItsValueIsBad) {
  const TemporaryFolder folder;
  write_version_5(folder / "a.h5");
  Spoiler(folder / "a.h5").set_number("/examples/bend", "confidence", -1);
  EXPECT_THAT(validate_bundle(folder / "a.h5"),
              ::testing::ElementsAre(HasSubstr("/examples/bend@confidence: expected a number >= 0, found -1")));
}

TEST(BundleOfVersion6, HasNoDoubtUnderItsFormerName) {
  const TemporaryFolder folder;
  write_bundle(small_model(), folder / "a.h5");
  Spoiler(folder / "a.h5").rename_attribute("/examples/bend", "doubt", "confidence");
  EXPECT_THAT(validate_bundle(folder / "a.h5"), ::testing::ElementsAre(HasSubstr("/examples/bend@doubt")));
}

// small_model() as version 1 wrote it.
void write_version_1(const std::filesystem::path& path) {
  ReducedModel model = small_model();
  model.polynomial.reset();
  model.targets.reset();
  model.target_space.reset();
  model.target_elasticity.reset();
  model.fidelity.reset();
  model.contact.reset();
  model.regions.clear();
  model.render.reset();
  write_bundle(model, path);
  Spoiler spoiler(path);
  spoiler.set_integer("/", "format_version", 1);
  spoiler.remove_attribute("/cubature", "internal_force");
  spoiler.remove_attribute("/cubature", "internal_force_reason");
  name_doubt_as_before(spoiler, "/examples", *model.examples);
}

TEST(BundleOfVersion1, IsRead) {
  const TemporaryFolder folder;
  write_version_1(folder / "a.h5");
  const ReducedModel model = read_bundle(folder / "a.h5");
  EXPECT_EQ(model.cubature->internal_force, ForceMethod::kCubature);
  EXPECT_EQ(model.cubature->internal_force_reason, "");
  EXPECT_EQ(model.cubature->method, CubatureMethod::kGreedy);
  EXPECT_THAT(validate_bundle(folder / "a.h5"), ::testing::IsEmpty());
  const BundleSummary summary = summarise_bundle(folder / "a.h5");
  EXPECT_EQ(summary.format_version, 1);
  EXPECT_EQ(summary.internal_force, ForceMethod::kCubature);
  EXPECT_FALSE(summary.has_polynomial || summary.has_targets);
}

TEST(BundleOfVersion1, HasNoNewerGroups) {
  const TemporaryFolder folder;
  write_version_1(folder / "a.h5");
  Spoiler(folder / "a.h5").add_group("/polynomial");
  try {
    read_bundle(folder / "a.h5", {.groups = plan_groups({.internal_force = ForceMethod::kPolynomial}, true, 3)});
    FAIL();
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(),
                HasSubstr("/polynomial: expected the group (the internal force is a polynomial), found none"));
    EXPECT_THAT(error.what(), HasSubstr("--scene SCENE.json or with \"polynomial\" as internal_force of the asset"));
  }
}

}  // namespace
}  // namespace exmat
