#include "precompute/training/training_runs.h"

#include <gtest/gtest.h>
#include <numbers>
#include <omp.h>

#include "tests/precompute/full_space/full_space_bar.h"

namespace exmat::precompute {
namespace training_runs_test {

struct Body {
  test::Bar bar = test::make_bar({.cells = {3, 1, 1}, .linear_modes = 3});
  FullSpaceModel model = build_full_space_model(bar.model);
  TrainingRunOptions options{.angular_frequency = 2 * std::numbers::pi * bar.model.modal->frequencies[0]};

  Segment push(double seconds, double force) const {
    Segment segment;
    segment.duration = seconds;
    segment.forces = {{{bar.model.object->mesh.vertex_count() - 1}, {0, 0, force}}};
    return segment;
  }
};

// A small constant force from rest: with the damping ratio z = 0.03 / 2 of the lowest mode and almost all of the motion
// in it, the tip swings to about 1 + exp(-pi z) times where it comes to rest, half a period after the start.
TEST(TrainingRuns, SwingAsTheLowestModeDoes) {
  const Body body;
  const double period = 2 * std::numbers::pi / body.options.angular_frequency;
  const TrainingRuns runs = run_segments(body.model, {{body.push(period, 1e-3)}}, body.options);
  EXPECT_EQ(runs.segments, 1);
  EXPECT_EQ(runs.steps, 200);
  ASSERT_EQ(runs.snapshots.cols(), 100);
  const Eigen::VectorXd mode = body.model.system.restrict(body.bar.model.modal->basis.col(0));
  const Eigen::VectorXd amounts = runs.snapshots.transpose() * (body.model.system.mass * mode);
  Eigen::Index farthest = 0;
  const double most = amounts.cwiseAbs().maxCoeff(&farthest);
  Eigen::VectorXd load = Eigen::VectorXd::Zero(body.bar.model.modal->basis.rows());
  load[load.size() - 1] = 1e-3;
  const double at_rest = std::abs(body.bar.model.modal->basis.col(0).dot(load)) /
                         (body.options.angular_frequency * body.options.angular_frequency);
  // Half a period is snapshot 49 or 50; BDF2 with 200 steps a period damps by less than 1 %.
  EXPECT_NEAR(static_cast<double>(farthest), 49.5, 1);
  EXPECT_NEAR(most / at_rest, 1 + std::exp(-std::numbers::pi * 0.015), 0.02);
}

TEST(TrainingRuns, GoOnWhereTheSegmentBeforeEnded) {
  const Body body;
  const double period = 2 * std::numbers::pi / body.options.angular_frequency;
  Segment rest = body.push(0.1 * period, 0);
  const TrainingRuns apart = run_segments(body.model, {{body.push(0.3 * period, 1)}, {rest}}, body.options);
  const TrainingRuns chain = run_segments(body.model, {{body.push(0.3 * period, 1), rest}}, body.options);
  const Eigen::Index first = apart.chain_ends.front();
  EXPECT_EQ(chain.chain_ends, std::vector<std::int64_t>{apart.chain_ends.back()});
  EXPECT_EQ(chain.snapshots.leftCols(first), apart.snapshots.leftCols(first));
  EXPECT_TRUE(apart.snapshots.rightCols(apart.snapshots.cols() - first).isZero(0));
  const double before = chain.snapshots.col(first - 1).norm(), after = chain.snapshots.col(first).norm();
  EXPECT_NEAR(after / before, 1, 0.1);  // two steps of 200 later
}

TEST(TrainingRuns, AreTheSameForEveryNumberOfThreads) {
  const Body body;
  const double period = 2 * std::numbers::pi / body.options.angular_frequency;
  const std::vector<Chain> chains{{body.push(0.2 * period, 1)}, {body.push(0.1 * period, -2)}, {body.push(0.1, 0.5)}};
  const int threads = omp_get_max_threads();
  omp_set_num_threads(1);
  const TrainingRuns one = run_segments(body.model, chains, body.options);
  omp_set_num_threads(3);
  const TrainingRuns three = run_segments(body.model, chains, body.options);
  omp_set_num_threads(threads);
  EXPECT_EQ(one.snapshots, three.snapshots);
}

TEST(TrainingRuns, BeginNoneAfterTheBudget) {
  Body body;
  body.options.budget = 1e-9;
  const TrainingRuns runs = run_segments(body.model, {{body.push(1, 1), body.push(1, 1)}}, body.options);
  EXPECT_EQ(runs.segments, 0);
  EXPECT_EQ(runs.skipped, 2);
  EXPECT_EQ(runs.snapshots.cols(), 0);
}

}  // namespace training_runs_test
}  // namespace exmat::precompute
