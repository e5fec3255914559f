#include <algorithm>
#include <functional>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "common/bundle/bundle.h"
#include "common/config/config.h"
#include "common/core/error.h"
#include "runtime/scene/scene_loader.h"
#include "tests/integration/support.h"

namespace exmat::test {
namespace leaving_out_test {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::StartsWith;
using Groups = std::vector<std::string>;

// The small bar's polynomial is several times faster than its cubature.
const Groups kPlain{"object", "modal", "cubature", "polynomial"};
const Groups kPlainAndRigid{"object", "modal", "cubature", "polynomial", "rigid"};
const Groups kWithExamples{"object",     "shape_space", "examples", "modal",       "cubature",
                           "polynomial", "projection",  "targets",  "target_space"};
const Groups kAll{"object",     "shape_space", "examples",     "modal",      "cubature", "polynomial",
                  "projection", "targets",     "target_space", "full_space", "rigid",    "contact"};

Groups without_group(Groups groups, const char* group) {
  std::erase(groups, group);
  return groups;
}

Groups and_full_space(Groups groups) {
  groups.push_back("full_space");
  return groups;
}

Groups and_contact(Groups groups) {
  groups.push_back("contact");
  return groups;
}

/// First components of the paths that h5dump lists; nothing without h5dump.
std::optional<std::set<std::string>> groups_by_h5dump(const std::filesystem::path& bundle) {
  const Outcome outcome = execute("h5dump", {"-n", bundle});
  if (outcome.status == 127) return std::nullopt;
  EXPECT_EQ(outcome.status, 0) << outcome.errors;
  std::set<std::string> groups;
  for (std::size_t at = 0; (at = outcome.output.find(" /", at)) != std::string::npos; at += 2) {
    const std::size_t end = outcome.output.find_first_of("/ \n", at + 2);
    if (end > at + 2) groups.insert(outcome.output.substr(at + 2, end - at - 2));
  }
  return groups;
}

class LeavingOut : public testing::Test {
 protected:
  /// Builds the small bar, writes bundle.h5 and expects these groups in it and no others.
  void expect_groups(const Json& changes, const std::optional<Needs>& needs, const Groups& groups) {
    Built built = build(write_small_bar(folder_, changes), needs);
    write_bundle(built.model, bundle_);
    EXPECT_EQ(summarise_bundle(bundle_).groups, groups);
    const std::set<std::string> expected(groups.begin(), groups.end());
    EXPECT_EQ(groups_by_h5dump(bundle_).value_or(expected), expected);
    const ReducedModel model = read_bundle(bundle_);
    EXPECT_EQ(model.examples.has_value(), std::ranges::count(groups, "examples") > 0);
    EXPECT_EQ(model.shape_space.has_value(), model.examples.has_value());
    EXPECT_EQ(model.projection.has_value(), model.examples.has_value());
    EXPECT_EQ(model.polynomial.has_value(), std::ranges::count(groups, "polynomial") > 0);
    EXPECT_EQ(model.targets.has_value(), std::ranges::count(groups, "targets") > 0);
    EXPECT_EQ(model.rigid.has_value(), std::ranges::count(groups, "rigid") > 0);
    EXPECT_EQ(model.contact.has_value(), std::ranges::count(groups, "contact") > 0);

    fill_bytes(built.model, built.report.ledger);
    Groups included;
    for (const LedgerEntry& entry : built.report.ledger) {
      EXPECT_EQ(entry.bytes > 0, entry.included) << entry.group;
      EXPECT_FALSE(entry.reason.empty()) << entry.group;
      if (entry.included) included.push_back(entry.group);
    }
    EXPECT_EQ(included, groups);
    // And fidelity, regions, render and skeleton, which there is nothing for, and target_elasticity.
    EXPECT_EQ(built.report.ledger.size(), kAll.size() + 5);
  }

  /// Datasets of bundle.h5 that the run time reads for a scene.
  std::vector<std::string> datasets_read(const char* members) {
    const auto loaded = runtime::load_run(load_scene(write_scene(folder_, Json::parse(members))));
    std::vector<std::string> datasets;
    for (const ReadRecord& record : loaded.records) datasets.push_back(record.dataset);
    for (const LedgerEntry& entry : loaded.ledger) {
      const auto of_group = [&](const ReadRecord& record) {
        return record.dataset.starts_with("/" + entry.group + "/");
      };
      EXPECT_EQ(entry.bytes > 0, std::ranges::any_of(loaded.records, of_group)) << entry.group;
    }
    return datasets;
  }

  Needs needs_of_scene(const char* members) { return needs_of(load_scene(write_scene(folder_, Json::parse(members)))); }

  static std::string refusal(const std::function<void()>& action) {
    try {
      action();
    } catch (const InputError& error) {
      return error.what();
    }
    return "no InputError";
  }

  TemporaryFolder folder_;
  std::filesystem::path bundle_ = folder_.path("bundle.h5");
  Json free_ = Json::parse(R"({ "object": { "fixed": null } })");
};

TEST_F(LeavingOut, AConstrainedBodyHoldsWhatItsSceneNeeds) {
  expect_groups(Json::object(), std::nullopt, and_contact(and_full_space(kWithExamples)));
  expect_groups(Json::object(), needs_of_scene(R"({ "examples": { "stiffness": 10 } })"), kWithExamples);
  expect_groups(Json::object(), needs_of_scene(R"({ "examples": { "stiffness": 10 }, "space": "auto" })"),
                and_full_space(kWithExamples));
  expect_groups(Json::object(), needs_of_scene(R"({ "space": "full" })"), kPlain);
  expect_groups(Json::object(), needs_of_scene("{}"), kPlain);
  expect_groups(Json::object(), needs_of_scene(R"({ "obstacles": [ { "sphere": { "radius": 1 } } ] })"),
                and_contact(kPlain));
  expect_groups(Json::parse(R"({ "examples": [] })"), std::nullopt, and_contact(kPlain));
}

TEST_F(LeavingOut, AFreeBodyHoldsItsRigidMotionToo) {
  expect_groups(free_, std::nullopt, kAll);
  expect_groups(free_, needs_of_scene("{}"), kPlainAndRigid);
  free_["examples"] = Json::array();
  expect_groups(free_, std::nullopt, and_contact(kPlainAndRigid));
}

TEST_F(LeavingOut, TheAssetNamesItsNeeds) {
  free_["needs"] = Json::array();
  expect_groups(free_, std::nullopt, kPlain);
  free_["needs"] = {"rigid"};
  expect_groups(free_, std::nullopt, kPlainAndRigid);
  free_["needs"] = {"rigid", "contact"};
  expect_groups(free_, std::nullopt, and_contact(kPlainAndRigid));
  free_["needs"] = Json::array({"examples"});
  expect_groups(free_, std::nullopt, without_group(kWithExamples, "targets"));
  free_["needs"] = {"examples", "targets"};
  expect_groups(free_, std::nullopt, kWithExamples);
  free_["needs"] = {"examples", "targets", "full_space"};
  expect_groups(free_, std::nullopt, and_full_space(kWithExamples));
  // A scene decides before the asset does.
  expect_groups(free_, needs_of_scene("{}"), kPlainAndRigid);
}

TEST_F(LeavingOut, APolynomialIsWrittenWhereItIsAskedFor) {
  const Json cubature = Json::parse(R"({ "internal_force": "cubature", "examples": [] })");
  expect_groups(cubature, std::nullopt, and_contact(without_group(kPlain, "polynomial")));
  EXPECT_EQ(summarise_bundle(bundle_).internal_force, ForceMethod::kCubature);
  // The scene decides before the asset does.
  expect_groups(cubature, needs_of_scene(R"({ "internal_force": "polynomial" })"), kPlain);
  EXPECT_EQ(summarise_bundle(bundle_).internal_force, ForceMethod::kPolynomial);
  expect_groups(cubature, needs_of_scene("{}"), without_group(kPlain, "polynomial"));
  expect_groups(Json::parse(R"({ "examples": [] })"), needs_of_scene(R"({ "internal_force": "cubature" })"),
                without_group(kPlain, "polynomial"));
}

TEST_F(LeavingOut, ATableOfTargetsIsLeftOutWhereTheSceneSolves) {
  expect_groups(Json::object(), needs_of_scene(R"({ "examples": { "stiffness": 10, "target": "solve" } })"),
                without_group(kWithExamples, "targets"));
}

TEST_F(LeavingOut, TheRunTimeReadsWhatItsSceneNeeds) {
  write_bundle(build(write_small_bar(folder_)).model, bundle_);
  const auto with = [](const char* prefix) { return Contains(StartsWith(prefix)); };
  const auto without = [](const char* prefix) { return ::testing::Not(Contains(StartsWith(prefix))); };

  const auto plain = datasets_read("{}");
  for (const char* group : {"/examples/", "/projection/", "/shape_space/", "/object/", "/modal/basis", "/rigid/"})
    EXPECT_THAT(plain, without(group));
  EXPECT_THAT(plain, AllOf(with("/cubature/gradient"), with("/modal/gravity_load")));

  const auto examples = datasets_read(R"({ "examples": { "stiffness": 10 } })");
  EXPECT_THAT(examples, AllOf(with("/examples/gram"), with("/projection/"), without("/object/"),
                              without("/modal/basis"), without("/shape_space/eigenfunctions")));

  const auto positions = datasets_read(R"({ "output": { "trajectory": "t.h5" } })");
  EXPECT_THAT(positions, AllOf(with("/object/vertices"), with("/modal/basis"), without("/examples/"),
                               without("/projection/"), without("/shape_space/")));
}

TEST_F(LeavingOut, AMissingGroupIsNamed) {
  write_bundle(build(write_small_bar(folder_), Needs{.examples = false}).model, bundle_);
  EXPECT_THAT(refusal([this] { datasets_read(R"({ "examples": { "stiffness": 10 } })"); }),
              AllOf(HasSubstr("bundle.h5"), HasSubstr("/examples")));

  write_bundle(build(write_small_bar(folder_, free_), Needs{.rigid = false}).model, bundle_);
  const BundleRequest request{plan_groups({}, /*constrained=*/false, /*example_count=*/2)};
  EXPECT_THAT(refusal([&] { read_bundle(bundle_, request); }), AllOf(HasSubstr("bundle.h5"), HasSubstr("/rigid")));
}

}  // namespace leaving_out_test
}  // namespace exmat::test
