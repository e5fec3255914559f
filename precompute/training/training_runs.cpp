#include "precompute/training/training_runs.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "common/core/progress.h"
#include "common/core/timer.h"
#include "precompute/full_space/full_space_stepper.h"

namespace exmat::precompute {
namespace {

constexpr int kStepsPerPeriod = 200;  // of the lowest mode
constexpr double kDamping = 0.03;     // of the stiffness, over omega_1

struct ChainRun {
  std::vector<Eigen::VectorXd> snapshots, displacements;
  std::int64_t segments = 0, skipped = 0, steps = 0;
};

class ChainRunner {
 public:
  ChainRunner(const FullSpaceModel& model, const TrainingRunOptions& options, const Timer& timer)
      : model_(model), options_(options), timer_(timer), stepper_(model) {
    scene_.time_step = time_step_of(options);
    scene_.mass_damping = options.mass_damping.value_or(0);
    scene_.stiffness_damping = stiffness_damping_of(options);
    scene_.newton = {20, 1e-6};
  }

  template <typename Advance>
  ChainRun run(const Chain& chain, Advance advance);

 private:
  void set_loads(const Segment& segment);
  FullSpaceState begin(const Segment& segment) const;

  const FullSpaceModel& model_;
  const TrainingRunOptions& options_;
  const Timer& timer_;
  FullSpaceScene scene_;
  FullSpaceStepper stepper_;
};

void ChainRunner::set_loads(const Segment& segment) {
  scene_.gravity = segment.gravity;
  scene_.forces = segment.forces;
  scene_.examples = segment.examples;
  scene_.obstacles.clear();
  if (segment.obstacle) scene_.obstacles.push_back(*segment.obstacle);
  stepper_.set(scene_);
}

FullSpaceState ChainRunner::begin(const Segment& segment) const {
  const Eigen::VectorXd rest = Eigen::VectorXd::Zero(model_.rest.size());
  if (!model_.frame) return make_full_space_state(model_, rest, rest);
  return make_full_space_state(model_, rest, segment.motion);
}

template <typename Advance>
ChainRun ChainRunner::run(const Chain& chain, Advance advance) {
  ChainRun result;
  FullSpaceState state = begin(chain.front());
  bool sound = true;
  for (const Segment& segment : chain) {
    const std::int64_t steps = steps_of(segment, options_);
    const bool late = options_.budget > 0 && timer_.seconds() > options_.budget;
    if (!sound || late) {
      ++result.skipped;
      advance(steps);
      continue;
    }
    set_loads(segment);
    state.begins_anew = true;
    for (std::int64_t i = 0; i < steps && sound; ++i) {
      sound = (stepper_.step(state).status & runtime::kStepNonFinite) == 0;
      ++result.steps;
      advance(1);
      if (!sound || (i + 1) % kStepsPerSnapshot != 0) continue;
      result.snapshots.push_back(deformation(model_, state.q));
      if (options_.positions) result.displacements.push_back(state.q);
    }
    ++(sound ? result.segments : result.skipped);
  }
  return result;
}

// [rows x N] of all runs.
Eigen::MatrixXd collect(const std::vector<ChainRun>& runs, std::vector<Eigen::VectorXd> ChainRun::*member,
                        Eigen::Index rows) {
  Eigen::Index count = 0;
  for (const ChainRun& run : runs) count += std::ssize(run.*member);
  Eigen::MatrixXd all(rows, count);
  Eigen::Index column = 0;
  for (const ChainRun& run : runs)
    for (const Eigen::VectorXd& one : run.*member) all.col(column++) = one;
  return all;
}

}  // namespace

double time_step_of(const TrainingRunOptions& options) {
  return 2 * std::numbers::pi / options.angular_frequency / kStepsPerPeriod;
}

double stiffness_damping_of(const TrainingRunOptions& options) {
  return options.stiffness_damping.value_or(kDamping / options.angular_frequency);
}

std::int64_t steps_of(const Segment& segment, const TrainingRunOptions& options) {
  return std::max<std::int64_t>(1, std::llround(segment.duration / time_step_of(options)));
}

std::int64_t step_count(const std::vector<Chain>& chains, const TrainingRunOptions& options) {
  std::int64_t count = 0;
  for (const Chain& chain : chains)
    for (const Segment& segment : chain) count += steps_of(segment, options);
  return count;
}

TrainingRuns run_segments(const FullSpaceModel& model, const std::vector<Chain>& chains,
                          const TrainingRunOptions& options) {
  const Timer timer;
  Progress progress("training runs", step_count(chains, options));
  std::vector<ChainRun> runs(chains.size());
#pragma omp parallel for schedule(dynamic)
  for (std::size_t i = 0; i < chains.size(); ++i)
    runs[i] = ChainRunner(model, options, timer).run(chains[i], [&](std::int64_t steps) {
#pragma omp critical(training_progress)
      progress.advance(steps);
    });
  TrainingRuns all;
  for (const ChainRun& run : runs) {
    all.segments += run.segments;
    all.skipped += run.skipped;
    all.steps += run.steps;
    const std::int64_t before = all.chain_ends.empty() ? 0 : all.chain_ends.back();
    all.chain_ends.push_back(before + std::ssize(run.snapshots));
  }
  all.snapshots = collect(runs, &ChainRun::snapshots, model.size());
  if (!options.positions) return all;
  all.deformations = model.system.extend(all.snapshots);
  all.displacements = model.system.extend(collect(runs, &ChainRun::displacements, model.size()));
  return all;
}

}  // namespace exmat::precompute
