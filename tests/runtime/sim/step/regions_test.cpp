#include <gtest/gtest.h>

#include "tests/support/allocation_counter.h"
#include "tests/support/scenes.h"

namespace exmat::runtime {
namespace {

using test::Bar;

// A bar and two regions that are all of it, with its examples.
Bar bar_of_regions(double density_gradient = 0, int examples = 3) {
  Bar bar = full_bar({.density_gradient = density_gradient, .examples = examples});
  for (const char* name : {"left", "right"}) {
    RegionData& region = bar.model.regions.emplace_back();
    region.name = name;
    region.examples = *bar.model.examples;
    region.projection = *bar.model.projection;
    region.targets = bar.model.targets;
  }
  return bar;
}

State run(const Model& model, StepScene scene, std::vector<ExampleSettings> examples, int steps = 40) {
  scene.examples = std::move(examples);
  scene.gravity_force = gravity_force(model, {0, -9.81, 0});
  scene.stiffness_damping = 0.001;
  State state = make_state(model);
  Workspace workspace(model, scene);
  for (int i = 0; i < steps; ++i) EXPECT_EQ(step(model, scene, state, workspace).status, 0U);
  return state;
}

const ExampleSettings kForce{300, 4, 0.5};

class RegionForces : public testing::TestWithParam<std::tuple<Integrator, bool, double>> {
 protected:
  static Integrator integrator() { return std::get<0>(GetParam()); }
  static bool table() { return std::get<1>(GetParam()); }
  std::unique_ptr<const Model> model(bool whole, std::vector<std::string> regions) const {
    ModelOptions options{.examples = whole, .target_table = table()};
    for (const std::string& region : regions) options.regions.push_back({region, table()});
    return prepared(bar_, options);
  }
  StepScene scene(const Model& model) const { return free_scene(model, integrator(), 0.01); }

  Bar bar_ = bar_of_regions(std::get<2>(GetParam()));
};
INSTANTIATE_TEST_SUITE_P(All, RegionForces,
                         testing::Combine(testing::ValuesIn(kIntegrators), testing::Bool(), testing::Values(0.0, 3.0)));

TEST_P(RegionForces, OfARegionThatIsAllAreThoseOfTheBody) {
  const auto whole = model(true, {}), local = model(false, {"right"});
  const State expected = run(*whole, scene(*whole), {kForce}), found = run(*local, scene(*local), {kForce});
  EXPECT_EQ(found.q, expected.q);
  EXPECT_EQ(found.examples[0].weights, expected.examples[0].weights);
  EXPECT_EQ(whole->example_count(), 3);
  EXPECT_EQ(whole->region(0), nullptr);
  EXPECT_EQ(local->example_count(), 0);
  EXPECT_EQ(local->region(0)->region, "right");
}

// Thirds of a force, of the body and two regions, with the weights of each: together the force. Its terms are added in
// another order, and forty steps amplify the rounding a little.
TEST_P(RegionForces, AddUp) {
  const auto whole = model(true, {}), parts = model(true, {"left", "right"});
  ExampleSettings third = kForce;
  third.stiffness /= 3;
  third.damping /= 3;
  const State expected = run(*whole, scene(*whole), {kForce});
  const State found = run(*parts, scene(*parts), {third, third, third});
  EXPECT_LE((found.q - expected.q).norm(), 1e-9 * expected.q.norm());
  for (const ExampleState& examples : found.examples)
    EXPECT_LE((examples.weights - expected.examples[0].weights).norm(), 1e-9);
}

TEST_P(RegionForces, AreLeftOutWhereTheyAreZero) {
  const auto whole = model(true, {}), parts = model(true, {"left", "right"});
  const State expected = run(*whole, scene(*whole), {kForce});
  const State found = run(*parts, scene(*parts), {kForce, {0, 0, 0.2}, {0, 0, 1}});
  EXPECT_EQ(found.q, expected.q);
  for (const std::size_t region : {1U, 2U}) {
    EXPECT_EQ(found.examples[region].weights, Eigen::Vector3d::UnitX());
    EXPECT_FALSE(found.examples[region].has_target);
  }
}

TEST_P(RegionForces, DoNotAllocate) {
  if (!test::AllocationCounter::works()) GTEST_SKIP() << "a sanitizer owns malloc";
  const auto parts = model(true, {"left", "right"});
  StepScene stepped = scene(*parts);
  stepped.examples = {kForce, {100, 1, 0.3}, {50, 0, 1}};
  State state = make_state(*parts);
  Workspace workspace(*parts, stepped);
  const test::AllocationCounter counter;
  for (int i = 0; i < 4; ++i) step(*parts, stepped, state, workspace);
  EXPECT_EQ(counter.count(), 0U);
}

TEST(RegionModel, ThatIsMissingIsNamed) {
  const Bar bar = bar_of_regions();
  const ModelResult result = build_model(bar.model, {.regions = {{"top"}}});
  EXPECT_FALSE(result.model);
  EXPECT_EQ(result.complaint.place, "/regions/top");
}

TEST(RegionModel, NamesTheElementThatAnExampleInverts) {
  Bar bar = bar_of_regions(0, 4);
  bar.model.regions[1].examples.examples[3].pose *= -20;
  const ModelResult result = build_model(bar.model, {.regions = {{"left"}, {"right"}}});
  EXPECT_FALSE(result.model);
  EXPECT_EQ(result.complaint.place, "/regions/right/examples/pose3");
}

}  // namespace
}  // namespace exmat::runtime
