#include <array>
#include <exmat/exmat.hpp>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <optional>
#include <string>
#include <vector>

#include "common/bundle/bundle.h"
#include "tests/support/allocation_counter.h"
#include "tests/support/synthetic_model.h"
#include "tests/support/temporary_folder.h"

namespace exmat::runtime {
namespace {

using ::testing::HasSubstr;

struct PushedKind {
  const char* name;
  bool is_free;
  std::int32_t space;
};

/// Forces by exmat.hpp, on bodies of each kind, which are compared by all numbers of their states, to the last bit.
class AppliedForcesOf : public ::testing::TestWithParam<PushedKind> {
 protected:
  AppliedForcesOf() {
    write_bundle(test::make_bar({.free = GetParam().is_free}).model, folder_ / "bar.h5");
    exmat_settings settings = exmat::default_settings();
    settings.time_step = 0.004;
    settings.space = GetParam().space;
    model_.emplace(folder_ / "bar.h5", settings);
    tip_.emplace(exmat::Points::vertices(*model_, std::array<std::int64_t, 1>{35}));
    patch_.emplace(exmat::Points::vertices(*model_, std::array<std::int64_t, 2>{32, 20}));
  }
  /// A body that has moved and deformed under a force of its own.
  exmat::Body moved() const {
    exmat::Body body(*model_);
    if (GetParam().is_free) body.set_motion({0, {0, 1, 0}, {0.8, 0, 0.6, 0}, {0.3, 0, 0}, {0, 0.2, 0.7}});
    body.apply_forces(*tip_, kFirst);
    body.step(10);
    return body;
  }

  // Sizes so far apart that a sum keeps few digits of the small ones.
  static constexpr std::array kFirst{0.1, 0.7, -0.3}, kThird{0.01, -0.2, 0.03};
  static constexpr std::array kSecond{3e5, 1e5, 7e4, -1e5, 0.3, 9e4}, kFourth{0.2, 0.1, 0.0, -0.1, 0.6, 0.3};
  test::TemporaryFolder folder_;
  std::optional<exmat::Model> model_;
  std::optional<exmat::Points> tip_, patch_;
};
INSTANTIATE_TEST_SUITE_P(Bodies, AppliedForcesOf,
                         ::testing::Values(PushedKind{"clamped", false, EXMAT_SPACE_REDUCED},
                                           PushedKind{"free", true, EXMAT_SPACE_REDUCED},
                                           PushedKind{"auto", true, EXMAT_SPACE_AUTO},
                                           PushedKind{"full", false, EXMAT_SPACE_FULL}),
                         [](const auto& test) { return std::string(test.param.name); });

TEST_P(AppliedForcesOf, ThatWereRemovedAreAsIfTheyHadNeverBeenApplied) {
  exmat::Body body = moved(), never = moved();
  const std::vector<double> before = body.state();
  const std::int64_t second = body.add_forces(*patch_, kSecond);
  EXPECT_NE(body.state(), before);
  body.apply_forces(*tip_, kThird);
  const std::int64_t fourth = body.add_forces(*patch_, kFourth);
  body.remove_forces(second);
  never.apply_forces(*tip_, kThird);
  never.apply_forces(*patch_, kFourth);
  EXPECT_EQ(body.state(), never.state());
  body.step(10);
  never.step(10);
  EXPECT_EQ(body.state(), never.state());

  exmat::Body without = moved();
  without.apply_forces(*tip_, kThird);
  const std::vector<double> applied = without.state();
  without.remove_forces(without.add_forces(*patch_, kSecond));
  EXPECT_EQ(without.state(), applied);
  body.remove_forces(fourth);
  EXPECT_NE(body.state(), never.state());
}

TEST_P(AppliedForcesOf, ThatWereChangedAreAsIfTheyHadBeenGivenSo) {
  exmat::Body body = moved(), given = moved();
  const std::int64_t id = body.add_forces(*patch_, kSecond);
  body.apply_forces(*tip_, kThird);
  body.set_forces(id, *patch_, kFourth);
  given.apply_forces(*tip_, kThird);
  given.apply_forces(*patch_, kFourth);
  EXPECT_EQ(body.state(), given.state());

  body.set_forces(id, *tip_, kThird);  // elsewhere
  exmat::Body elsewhere = moved();
  for (int i = 0; i < 2; ++i) elsewhere.apply_forces(*tip_, kThird);
  EXPECT_EQ(body.state(), elsewhere.state());
  if (!test::AllocationCounter::works()) return;
  const test::AllocationCounter counter;
  body.set_forces(id, *patch_, kFourth);
  body.remove_forces(id);
  EXPECT_EQ(counter.count(), 0U);
}

TEST_P(AppliedForcesOf, EndWithWhatEndsAllForces) {
  exmat::Body body(*model_), other(*model_);
  const auto refuses = [&](std::int64_t id) {
    EXPECT_EQ(exmat_body_set_forces(body.get(), id, tip_->get(), kFirst.data(), 3), EXMAT_INVALID_ARGUMENT);
    EXPECT_EQ(exmat_body_remove_forces(body.get(), id), EXMAT_INVALID_ARGUMENT);
    EXPECT_THAT(exmat_last_error(), HasSubstr("exmat_body_remove_forces: id = " + std::to_string(id)));
  };
  const std::vector<double> at_rest = body.state();
  const std::int64_t cleared = body.add_forces(*tip_, kFirst);
  body.clear_forces();
  EXPECT_EQ(body.state(), at_rest);
  const std::int64_t reset = body.add_forces(*tip_, kFirst);
  body.reset();
  other.reset();
  EXPECT_EQ(body.state(), other.state());
  const std::int64_t replaced = body.add_forces(*tip_, kFirst);
  const std::vector<double> pushed = body.state();
  body.set_state(pushed);
  EXPECT_EQ(body.state(), pushed) << "it has the sum";
  for (const std::int64_t id : {cleared, reset, replaced, std::int64_t{-1}, replaced + 1}) refuses(id);
  EXPECT_THAT((std::array{cleared, reset, replaced}), ::testing::ElementsAre(0, 1, 2));
  body.remove_forces(body.add_forces(*tip_, kThird));
  EXPECT_EQ(body.state(), pushed);
}

TEST_P(AppliedForcesOf, ThatWereRemovedLoseNoWork) {
  const exmat::Capacity capacity(*model_, 0.1);
  exmat::Body body(*model_), never(*model_);
  for (exmat::Body* each : {&body, &never}) {
    each->set_capacity(&capacity);
    each->apply_forces(*tip_, kFirst);
  }
  const std::int64_t id = body.add_forces(*patch_, kFourth);
  const double lost_with = body.step().lost_applied, lost_without = never.step().lost_applied;
  EXPECT_EQ(lost_with == lost_without, GetParam().space != EXMAT_SPACE_REDUCED) << "all vertices lose nothing";
  body.remove_forces(id);
  EXPECT_EQ(body.step().lost_applied, never.step().lost_applied);
}

}  // namespace
}  // namespace exmat::runtime
