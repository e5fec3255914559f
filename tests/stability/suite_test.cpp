#include "tests/stability/suite.h"

#include <algorithm>
#include <cmath>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <numbers>
#include <set>

#include "common/core/decompositions.h"
#include "common/mesh/checks.h"
#include "common/mesh/geometry.h"
#include "tests/integration/support.h"
#include "tests/stability/suite_report.h"

namespace exmat::precompute {
namespace {

constexpr double kDegree = std::numbers::pi / 180;

std::vector<StabilityCase> cases_of(const std::set<std::string>& groups) {
  std::vector<StabilityCase> cases = short_stability_suite();
  std::erase_if(cases, [&](const StabilityCase& test) { return !groups.contains(test.group); });
  return cases;
}

std::string all(const std::vector<const StabilityRun*>& runs) {
  std::string text;
  for (const StabilityRun* run : runs) text += describe(run->test) + ": " + describe_failures(*run) + "\n";
  return text;
}

class StabilityGroups : public testing::TestWithParam<const char*> {};
INSTANTIATE_TEST_SUITE_P(All, StabilityGroups,
                         testing::Values("stiffness", "loads", "starts", "spin", "contact", "bodies", "examples",
                                         "examples on the ground", "polynomial", "slivers", "no damping",
                                         "stiffness, mixed", "loads, mixed", "starts, mixed", "spin, mixed",
                                         "examples, mixed", "slivers, mixed", "no damping, mixed", "starts, full",
                                         "contact, auto", "slivers, full", "slivers, auto", "no damping, full"),
                         [](const auto& group) {
                           std::string name = group.param;
                           std::erase_if(name, [](char c) { return c == ' ' || c == ','; });
                           return name;
                         });

TEST_P(StabilityGroups, MeetEveryBoundOrEndAtAKnownLimit) {
  const auto runs = run_stability(cases_of({GetParam()}));
  ASSERT_FALSE(runs.empty());
  EXPECT_THAT(runs_with(runs, Verdict::kFail), testing::IsEmpty()) << all(runs_with(runs, Verdict::kFail));
  for (const StabilityRun& run : runs) {
    EXPECT_EQ(run.result.non_finite_steps, 0) << describe(run.test);
    // Only the search for a minimum may end early by default, and nothing but that.
    if (run.test.integrator == Integrator::kNewmark) continue;
    EXPECT_NE(run.result[Check::kBounded].verdict, Verdict::kKnownLimit) << describe(run.test);
    if (run.test.space == Space::kReduced)
      EXPECT_NE(run.result[Check::kRest].verdict, Verdict::kKnownLimit) << describe(run.test);
    if (run.result.limit_id(Check::kEnergy) == "bodies-turn") continue;
    EXPECT_NE(run.result[Check::kEnergy].verdict, Verdict::kKnownLimit) << describe(run.test);
  }
}

/// The limit "friction-couple" and its reason: it goes with friction, and as the square of the time step.
TEST(Stability, ThePileThatDoesNotComeToRestIsHeldByACoupleOfFriction) {
  auto cases = cases_of({"bodies"});
  std::erase_if(cases, [](const StabilityCase& test) {
    return test.company != Company::kPile || test.contact_stiffness > 1e4 || test.time_step < 1.0 / 40 ||
           test.examples.stiffness > 0;
  });
  ASSERT_EQ(cases.size(), 1U);
  StabilityCase smooth = cases[0], fine = cases[0];
  smooth.friction = 0.02;
  fine.time_step /= 4;
  cases.push_back(smooth);
  cases.push_back(fine);
  const auto runs = run_stability(cases, {.most_steps = 12000});
  const auto rest = [&](std::size_t i) { return runs[i].result[Check::kRest]; };
  EXPECT_EQ(runs[0].result.limit_id(Check::kRest), "friction-couple");
  EXPECT_EQ(rest(1).verdict, Verdict::kPass) << rest(1).value;
  EXPECT_NEAR(rest(2).value, rest(0).value / 16, 0.2 * rest(0).value / 16);
}

TEST(Stability, SuiteReachesEveryExtreme) {
  const auto cases = short_stability_suite();
  const auto any = [&](auto matches) { return std::ranges::any_of(cases, matches); };
  for (const auto integrator : {Integrator::kBdf2, Integrator::kBackwardEuler, Integrator::kNewmark})
    for (const auto material :
         {MaterialModel::kStVenantKirchhoff, MaterialModel::kStableNeoHookean, MaterialModel::kCorotational})
      for (const bool free : {false, true})
        for (const auto& [E, nu, density] : {std::array{1e3, 0.0, 1e5}, {1e3, 0.4999, 1.0}, {1e12, 0.4999, 1.0}})
          for (const double dt : {1e-4, 1.0 / 30})
            EXPECT_TRUE(any([&, E = E, nu = nu, density = density](const StabilityCase& test) {
              const BodySpec& body = test.body;
              return test.integrator == integrator && body.material == material && body.free == free &&
                     body.youngs_modulus == E && body.poisson_ratio == nu && body.density == density &&
                     test.time_step == dt;
            })) << E
                << " " << nu << " " << dt;
  EXPECT_TRUE(any([](const StabilityCase& test) { return test.spin == 1000; }));
  EXPECT_TRUE(any([](const StabilityCase& test) { return test.examples.stiffness == 1e10; }));
  EXPECT_TRUE(any([](const StabilityCase& test) { return test.contact_stiffness == 1e10; }));
  EXPECT_TRUE(any([](const StabilityCase& test) { return test.ground == Ground::kMesh && test.velocity == 50; }));
  EXPECT_TRUE(any([](const StabilityCase& test) { return test.ground == Ground::kHills && test.velocity == 50; }));
  for (const Ground ground : {Ground::kSphere, Ground::kBox, Ground::kCapsule})
    EXPECT_TRUE(any([&](const StabilityCase& test) { return test.ground == ground && test.velocity == 50; }));
  for (const Company company : {Company::kPile, Company::kPair, Company::kCarried, Company::kItself})
    for (const double stiffness : {1e4, 1e10})
      for (const double dt : {1e-3, 1.0 / 30})
        EXPECT_TRUE(any([&](const StabilityCase& test) {
          return test.company == company && test.contact_stiffness == stiffness && test.time_step == dt;
        }));
  for (const Company company : {Company::kNone, Company::kPile})
    EXPECT_TRUE(any([&](const StabilityCase& test) {
      return test.ground == Ground::kPlane && test.body.examples != BodyExamples::kNone && test.company == company;
    }));
  EXPECT_TRUE(any([](const StabilityCase& test) { return test.body.polynomial; }));
  EXPECT_TRUE(any([](const StabilityCase& test) { return test.body.region; }));
  EXPECT_TRUE(any([](const StabilityCase& test) {
    return test.body.elastic && test.body.energy_reference == EnergyReference::kRest;
  }));
  EXPECT_TRUE(any([](const StabilityCase& test) { return test.damping == 0 && test.gravity == 0; }));
  EXPECT_TRUE(any([](const StabilityCase& test) { return test.body.examples == BodyExamples::kNearDuplicates; }));
  EXPECT_TRUE(any([](const StabilityCase& test) { return test.body.examples == BodyExamples::kRestAlone; }));
}

// Each of them is a case in double precision, steps otherwise, and comes near to where that does.
TEST(Stability, MixedRunsAreThoseThatLanesTakeInMixedPrecision) {
  const auto cases = short_stability_suite();
  std::vector<StabilityCase> both;
  std::set<std::string> groups;
  for (const StabilityCase& mixed : cases) {
    if (mixed.precision != Precision::kMixed) continue;
    groups.insert(mixed.group);
    EXPECT_TRUE(mixed.ground == Ground::kNone && mixed.company == Company::kNone) << describe(mixed);
    const auto is_same = [&](const StabilityCase& test) {
      return test.precision == Precision::kDouble && test.group + ", mixed" == mixed.group &&
             test.extreme == mixed.extreme && test.body == mixed.body && test.integrator == mixed.integrator &&
             test.time_step == mixed.time_step;
    };
    const auto same = std::ranges::find_if(cases, is_same);
    ASSERT_NE(same, cases.end()) << describe(mixed);
    if (mixed.group != "no damping, mixed" || mixed.integrator != Integrator::kBdf2 || mixed.time_step > 0.01) continue;
    both.push_back(*same);
    both.push_back(mixed);
  }
  EXPECT_EQ(groups, (std::set<std::string>{"stiffness, mixed", "loads, mixed", "starts, mixed", "spin, mixed",
                                           "examples, mixed", "slivers, mixed", "no damping, mixed"}));
  const auto runs = run_stability(both, {.most_steps = 20});
  int different = 0;
  for (std::size_t i = 0; i < runs.size(); i += 2) {
    const double moved = runs[i].result.largest_displacement, mixed = runs[i + 1].result.largest_displacement;
    EXPECT_NEAR(mixed, moved, 1e-4 * (1e-6 + moved)) << describe(runs[i + 1].test);
    different += mixed != moved ? 1 : 0;
  }
  EXPECT_GT(different, std::ssize(runs) / 4) << "of " << runs.size() / 2;
}

// A corner of a cube: 90 degrees at its edges, atan(sqrt 2) at the others.
TEST(Stability, DihedralAnglesAreThoseOfACorner) {
  TetMesh corner;
  corner.vertices.resize(4, 3);
  corner.vertices << 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1;
  corner.tets.resize(1, 4);
  corner.tets << 0, 1, 2, 3;
  EXPECT_NEAR(least_dihedral(corner), std::atan(std::sqrt(2.0)), 1e-14);
}

TEST(Stability, SliversAreSlivers) {
  for (const bool slivers : {false, true}) {
    TetMesh mesh = stability_mesh(slivers);
    EXPECT_EQ(check_mesh(mesh, "mesh", {}).reoriented_tets, 0);
    EXPECT_NEAR(tet_volumes(mesh).sum(), 1 * 0.25 * 0.2, 1e-12);
    const double least = least_dihedral(mesh);
    EXPECT_TRUE(slivers ? least > 0.9 * kDegree && least <= kDegree : least > 20 * kDegree) << least / kDegree;
  }
}

TEST(Stability, StartsAreAsExtremeAsTheyAreCalled) {
  auto cases = cases_of({"starts"});
  std::erase_if(cases, [](const StabilityCase& test) { return test.integrator != Integrator::kBdf2; });
  for (const StabilityRun& run : run_stability(cases, {.most_steps = 1})) {
    const double inverted = run.result.start_inverted;
    switch (run.test.start) {
      case Start::kInverted:  // rings at the clamp and at a border of what is turned have tets of both kinds
        EXPECT_GE(inverted, run.test.body.free ? 0.8 : 0.4) << describe(run.test);
        break;
      case Start::kFlattened:  // as many elements are turned as are left: a plane, as far as the basis can say it
        EXPECT_NEAR(inverted, 0.5, 0.15) << describe(run.test);
        break;
      case Start::kCollapsed:
        EXPECT_GE(inverted, 0.2) << describe(run.test);
        break;
      default:
        EXPECT_NEAR(run.result.largest_displacement, run.test.reach, 0.3) << describe(run.test);
    }
  }
}

// |U_v q| <= reach |q|_K for every pose, and for one of them there is no less.
TEST(Stability, ReachBoundsDisplacementsByEnergy) {
  BodyStore bodies;
  const StudyBody& body = bodies.get({});
  const RowMatrix& U = body.reduced.modal->basis;
  double largest = 0;
  for (Eigen::Index row = 0; row < U.rows(); ++row) {
    if (body.reduced.object->fixed[row / 3] != 0) continue;
    // The pose of least energy that moves this coordinate by one.
    const Eigen::VectorXd q = body.rest_stiffness.ldlt().solve(U.row(row).transpose());
    const Eigen::VectorXd u = U * q / std::sqrt(q.dot(body.rest_stiffness * q));
    for (Eigen::Index v = 0; v < u.size() / 3; ++v) {
      EXPECT_LE(u.segment<3>(3 * v).norm(), body.reach * (1 + 1e-9));
      largest = std::max(largest, u.segment<3>(3 * v).norm());
    }
  }
  EXPECT_GE(largest, 0.99 * body.reach);
}

TEST(Stability, ResultsDoNotDependOnTheNumberOfJobs) {
  auto cases = cases_of({"spin", "contact"});
  cases.resize(30);
  const auto one = run_stability(cases, {.most_steps = 100, .jobs = 1});
  const auto two = run_stability(cases, {.most_steps = 100, .jobs = 2});
  EXPECT_EQ(suite_json(one), suite_json(two));
}

// The suite has to fail without a safeguard of the step: that is what it is for. Of 132 runs each, 25 and 49 did.
std::vector<StabilityRun> runs_with_fault(const runtime::NewtonPolicy& policy) {
  auto cases = cases_of({"loads", "starts"});
  std::erase_if(cases, [](const StabilityCase& test) { return test.integrator != Integrator::kBdf2; });
  return run_stability(cases, {.most_steps = 200, .policy = policy});
}

TEST(Stability, SeesThatTheLineSearchIsMissing) {
  const auto runs = runs_with_fault({.line_search = false});
  const auto failed = runs_with(runs, Verdict::kFail);
  ASSERT_GE(failed.size(), 10U);
  EXPECT_TRUE(std::ranges::any_of(runs, [](const auto& run) { return run.result.non_finite_steps > 0; }));
  // Failures are shown.
  for (const std::string& text : {suite_markdown(runs), suite_html(runs), suite_csv(runs)})
    EXPECT_THAT(text, testing::HasSubstr(describe_failures(*failed.front())));
  EXPECT_EQ(nlohmann::json::parse(suite_json(runs))["failed"], failed.size());
}

TEST(Stability, SeesThatTheProjectionIsMissing) {
  EXPECT_GE(runs_with(runs_with_fault({.projection = false}), Verdict::kFail).size(), 20U);
}

TEST(Stability, ReportHasEveryRun) {
  const test::TemporaryFolder folder;
  auto cases = cases_of({"spin"});
  cases.resize(3);
  write_suite_report(run_stability(cases, {.most_steps = 5}), folder.path("out"));
  EXPECT_EQ(nlohmann::json::parse(test::read_file(folder.path("out") / "stability.json"))["runs"].size(), 3U);
  for (const char* name : {"stability.html", "stability.md", "stability.csv"})
    EXPECT_FALSE(test::read_file(folder.path("out") / name).empty()) << name;
}

}  // namespace
}  // namespace exmat::precompute
