#include "common/model/needs.h"

#include <gtest/gtest.h>

namespace exmat {
namespace {

LedgerEntry entry_of(const std::vector<LedgerEntry>& ledger, std::string_view group) {
  for (const LedgerEntry& entry : ledger)
    if (entry.group == group) return entry;
  ADD_FAILURE() << group;
  return {};
}

TEST(PlanGroups, TablesTargetsOfTwoExamplesAndMore) {
  for (const std::int64_t count : {0, 1, 2, 3, 4, 5, 64})
    EXPECT_EQ(includes(plan_groups({}, true, count), "targets"), count >= 2) << count;
  EXPECT_FALSE(includes(plan_groups({.targets = false}, true, 2), "targets"));
  EXPECT_FALSE(includes(plan_groups({.examples = false}, true, 2), "targets"));
}

TEST(PlanGroups, SaysWhyThereAreNoTargets) {
  const auto reason = [](const Needs& needs, std::int64_t count) {
    return entry_of(plan_groups(needs, true, count), "targets").reason;
  };
  EXPECT_EQ(reason({}, 0), "the asset has no examples");
  EXPECT_EQ(reason({}, 1), "the rest pose is the only example");
  EXPECT_EQ(reason({.targets = false}, 2), "no table of targets is asked for");
  EXPECT_EQ(reason({.examples = false}, 2), "no example force is asked for");
}

TEST(PlanGroups, HasAPolynomialUnlessTheForceIsByCubature) {
  for (const ForceMethod choice : {ForceMethod::kAuto, ForceMethod::kCubature, ForceMethod::kPolynomial}) {
    const auto ledger = plan_groups({.internal_force = choice}, false, 0);
    EXPECT_EQ(includes(ledger, "polynomial"), choice != ForceMethod::kCubature) << name_of(choice);
    EXPECT_TRUE(includes(ledger, "cubature"));
  }
}

TEST(PlanGroups, HasContactWhereItIsAskedFor) {
  for (const bool constrained : {true, false})
    for (const bool contact : {true, false})
      EXPECT_EQ(includes(plan_groups({.contact = contact}, constrained, 0), "contact"), contact);
}

TEST(PlanGroups, HasARenderMeshWhereTheAssetNamesOneAndItIsAskedFor) {
  EXPECT_TRUE(includes(plan_groups({}, true, 0, 0, true), "render"));
  EXPECT_EQ(entry_of(plan_groups({}, true, 0, 0, false), "render").reason, "the asset has no render mesh");
  const LedgerEntry entry = entry_of(plan_groups({.render = false}, true, 0, 0, true), "render");
  EXPECT_FALSE(entry.included);
  EXPECT_EQ(entry.reason, "the render mesh is not asked for");
}

}  // namespace
}  // namespace exmat
