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

}  // namespace
}  // namespace exmat::precompute
