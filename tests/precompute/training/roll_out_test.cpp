#include "precompute/training/roll_out.h"

#include <gtest/gtest.h>
#include <numbers>

#include "tests/precompute/full_space/full_space_bar.h"

namespace exmat::precompute {
namespace {

class RollOutOf : public ::testing::TestWithParam<bool> {
 protected:
  bool is_free() const { return GetParam(); }

  Chain chain(const ReducedModel& model, double period) const {
    Segment segment;
    segment.duration = 0.3 * period;
    segment.gravity = {0, 0, -1};
    if (!is_free()) segment.forces = {{{model.object->mesh.vertex_count() - 1}, {0, 2, 0}}};
    if (is_free()) {
      segment.motion.linear_velocity = {0.1, 0, 0};
      segment.motion.angular_velocity = {0, 0.5, 2};
      segment.forces = {{{0, model.object->mesh.vertex_count() - 1}, {0, 1, 0.5}}};
    }
    return {segment};
  }
};

INSTANTIATE_TEST_SUITE_P(ClampedAndFree, RollOutOf, ::testing::Bool());

// With all modes in its basis the reduced body is the full one in other coordinates. A clamped one differs by the
// tolerances of both Newton methods; a free one by how its moving frame is integrated, too: with 200 steps a period of
// the lowest mode less than 1 %.
TEST_P(RollOutOf, ACompleteBasisIsTheFullSpace) {
  const test::Bar bar = complete_bar({.cells = {2, 1, 1}, .free = is_free()});
  const FullSpaceModel full = build_full_space_model(bar.model);
  const TrainingRunOptions options{.angular_frequency = 2 * std::numbers::pi * bar.model.modal->frequencies[0],
                                   .positions = true};
  const std::vector<Chain> chains{chain(bar.model, 2 * std::numbers::pi / options.angular_frequency)};
  const TrainingRuns runs = run_segments(full, chains, options);
  ASSERT_EQ(runs.segments, 1);
  const RollOut error = roll_out(bar.model, EnergyReference::kExample, chains, runs, full.system.full_mass, options);
  const double limit = is_free() ? 1e-2 : 1e-4;
  EXPECT_LE(error.shape, limit);
  EXPECT_LE(error.position, limit);
  EXPECT_LE(error.end, 2 * limit);
  EXPECT_LE(error.settled, 2 * limit);
}

// A basis of three modes is off by what they leave out; where and how much, by the vertices themselves.
TEST(RollOut, MeasuresWhatABasisLeavesOut) {
  test::Bar bar = test::make_bar({.cells = {3, 1, 1}, .linear_modes = 1});
  const FullSpaceModel full = build_full_space_model(bar.model);
  const TrainingRunOptions options{.angular_frequency = 2 * std::numbers::pi * bar.model.modal->frequencies[0],
                                   .positions = true};
  const double period = 2 * std::numbers::pi / options.angular_frequency;
  // Along the stiff axis: hardly any of it is in the one mode, which bends.
  Segment segment;
  segment.duration = 0.2 * period;
  segment.gravity = {5, 0, 0};
  const std::vector<Chain> chains{{segment}};
  const TrainingRuns runs = run_segments(full, chains, options);
  const RollOut error = roll_out(bar.model, EnergyReference::kExample, chains, runs, full.system.full_mass, options);
  EXPECT_NEAR(error.shape, 1, 0.05);
  EXPECT_EQ(error.shape, error.position);
  double farthest = 0;
  for (const auto& u : runs.deformations.colwise())
    farthest = std::max(farthest, u.reshaped<Eigen::RowMajor>(u.size() / 3, 3).rowwise().norm().maxCoeff());
  EXPECT_NEAR(error.worst_distance, farthest, 0.1 * farthest);
  EXPECT_GT(bar.model.object->mesh.vertices(error.worst_vertex, 0), 0.9);
}

// The mode that a basis of one has bends the bar far; along the stiff axis it does not move at all. The figure is that
// of the kind which the basis lacks, however little that moves the body, unless rounding is all that moves it.
TEST(RollOut, IsThatOfTheWorstKindOfLoad) {
  test::Bar bar = test::make_bar({.cells = {3, 1, 1}, .linear_modes = 1});
  const FullSpaceModel full = build_full_space_model(bar.model);
  const TrainingRunOptions options{.angular_frequency = 2 * std::numbers::pi * bar.model.modal->frequencies[0],
                                   .positions = true};
  const double period = 2 * std::numbers::pi / options.angular_frequency;
  Segment along, bending;
  along.kind = "along";
  bending.kind = "bending";
  along.duration = bending.duration = 0.2 * period;
  along.gravity = {5, 0, 0};
  // The force of the mode's own shape.
  const Eigen::VectorXd mode = full.system.full_mass * bar.model.modal->basis.col(0);
  for (Eigen::Index v = 0; v < mode.size() / 3; ++v) bending.forces.push_back({{v}, 20 * mode.segment<3>(3 * v)});
  const auto errors = [&](const std::vector<Chain>& chains) {
    const TrainingRuns runs = run_segments(full, chains, options);
    return roll_out(bar.model, EnergyReference::kExample, chains, runs, full.system.full_mass, options);
  };
  const RollOut alone = errors({{along}}), other = errors({{bending}});
  ASSERT_LE(other.shape, 0.5 * alone.shape) << "the test would not notice";
  for (const std::vector<Chain>& chains : {std::vector<Chain>{{along}, {bending}}, {{bending}, {along}}}) {
    const RollOut both = errors(chains);
    EXPECT_EQ(both.kind, "along");
    EXPECT_DOUBLE_EQ(both.shape, alone.shape);
    EXPECT_DOUBLE_EQ(both.settled, alone.settled);
    EXPECT_EQ(both.worst_distance, std::max(alone.worst_distance, other.worst_distance));
  }
  along.gravity *= 1e-9;
  EXPECT_EQ(errors({{along}, {bending}}).kind, "bending");
}

}  // namespace
}  // namespace exmat::precompute
