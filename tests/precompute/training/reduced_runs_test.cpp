#include "precompute/training/reduced_runs.h"

#include <gtest/gtest.h>
#include <numbers>

#include "tests/precompute/full_space/full_space_bar.h"

namespace exmat::precompute {
namespace {

// With all modes in its basis a clamped reduced body is the full one in other coordinates, but for the tolerances of
// both Newton methods.
TEST(ReducedRuns, OfACompleteBasisAreThoseInFullSpace) {
  const test::Bar bar = complete_bar({.cells = {2, 1, 1}});
  const FullSpaceModel full = build_full_space_model(bar.model);
  const TrainingRunOptions options{.angular_frequency = 2 * std::numbers::pi * bar.model.modal->frequencies[0],
                                   .positions = true};
  Segment push, fall;
  push.duration = fall.duration = 0.1 * 2 * std::numbers::pi / options.angular_frequency;
  push.forces = {{{bar.model.object->mesh.vertex_count() - 1}, {0, 2, 0}}};
  fall.gravity = {0, 0, -1};
  const std::vector<Chain> chains{{push, fall}, {fall}};
  const TrainingRuns expected = run_segments(full, chains, options);
  const TrainingRuns found = reduced_training_runs(bar.model, EnergyReference::kExample, chains, full.system, options);
  EXPECT_EQ(found.segments, 3);
  EXPECT_EQ(found.skipped, 0);
  EXPECT_EQ(found.steps, expected.steps);
  EXPECT_EQ(found.chain_ends, expected.chain_ends);
  const auto near = [](const Eigen::MatrixXd& a, const Eigen::MatrixXd& b) { return (a - b).norm() / b.norm(); };
  EXPECT_LE(near(found.snapshots, expected.snapshots), 1e-4);
  EXPECT_LE(near(found.deformations, expected.deformations), 1e-4);
  EXPECT_LE(near(found.displacements, expected.displacements), 1e-4);
}

}  // namespace
}  // namespace exmat::precompute
