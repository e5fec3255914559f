#include "runtime/io/scene_run.h"

#include <fmt/format.h>

#include "common/core/error.h"
#include "common/core/progress.h"
#include "common/core/timer.h"
#include "runtime/io/trajectory.h"

namespace exmat::runtime {
namespace {

std::unique_ptr<TrajectoryWriter> open_trajectory(const LoadedScene& loaded, const SceneConfig& config) {
  if (!config.trajectory) return nullptr;
  const bool examples = runs_examples(*loaded.model, loaded.scene);
  const TrajectoryInfo info{config.integrator, config.time_step, 1 + config.steps / config.every,
                            examples ? loaded.model->example_count() : 0};
  return std::make_unique<TrajectoryWriter>(*config.trajectory, loaded.data, info);
}

[[noreturn]] void fail_non_finite(const State& state, const SceneConfig& config) {
  throw WorkError(
      fmt::format("{}: step {} (t = {:g} s): the state is no longer finite; try a smaller time_step (now {:g} s), "
                  "smaller loads or example "
                  "stiffness, or the integrator backward_euler. No trajectory was written",
                  config.file.string(), state.step + 1, state.time + config.time_step, config.time_step));
}

void add_report(const StepReport& report, double seconds, RunSummary& summary) {
  ++summary.steps;
  summary.step_seconds.add(seconds);
  summary.newton_iterations.add(report.newton_iterations);
  summary.target_iterations.add(report.target_iterations);
  summary.projections += report.projections;
  if (report.status != 0) ++summary.unconverged_steps;
}

void add_profile(const Profile& profile, std::array<Samples, kStageNames.size()>& stages) {
  for (std::size_t stage = 0; stage < stages.size(); ++stage) stages[stage].add(profile.seconds[stage]);
}

RunSummary empty_summary(std::int64_t steps, bool profiled) {
  RunSummary summary;
  summary.step_seconds = summary.newton_iterations = summary.target_iterations = Samples(steps);
  if (profiled) summary.stage_seconds.emplace().fill(Samples(steps));
  return summary;
}

}  // namespace

RunSummary run(const LoadedScene& loaded, const SceneConfig& config, bool profiled) {
  RunSummary summary = empty_summary(config.steps, profiled);
  Workspace workspace(*loaded.model, loaded.scene);
  Profile profile;
  if (profiled) workspace.profile = &profile;
  State state = make_state(*loaded.model);
  refresh_weights(*loaded.model, loaded.scene, state, workspace);
  const auto trajectory = open_trajectory(loaded, config);
  if (trajectory) trajectory->append(state, energies(loaded.scene, state), 0);

  Progress progress("steps", config.steps);
  while (state.step < config.steps) {
    profile = {};
    const Timer timer;
    const StepReport report = step(*loaded.model, loaded.scene, state, workspace);
    const double seconds = timer.seconds();
    if ((report.status & kStepNonFinite) != 0) fail_non_finite(state, config);
    add_report(report, seconds, summary);
    if (trajectory && state.step % config.every == 0) {
      const StageTimer output(workspace.profile, Stage::kOutput);
      trajectory->append(state, energies(loaded.scene, state), seconds);
    }
    if (profiled) add_profile(profile, *summary.stage_seconds);
    progress.advance();
  }
  if (trajectory) {
    trajectory->finish();
    summary.largest_displacement = trajectory->largest_displacement();
  }
  summary.simulated_seconds = state.time;
  summary.energies = energies(loaded.scene, state);
  return summary;
}

}  // namespace exmat::runtime
