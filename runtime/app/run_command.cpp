#include <fmt/format.h>

#include "common/config/config.h"
#include "common/core/log.h"
#include "runtime/app/commands.h"
#include "runtime/app/loading_log.h"
#include "runtime/app/print.h"
#include "runtime/scene/scene_run.h"

namespace exmat::runtime {
namespace {

std::string microseconds(double seconds) { return fmt::format("{:.2f} us", 1e6 * seconds); }

void print_summary(const RunSummary& summary, const LoadedScene& loaded, const SceneConfig& config) {
  const double mean = summary.step_seconds.mean();
  print("steps", std::to_string(summary.steps));
  if (summary.bodies > 1) {
    print("bodies", fmt::format("{} (energies and trajectory are those of the first)", summary.bodies));
    print("threads", std::to_string(summary.threads));
  }
  print("simulated time", fmt::format("{:g} s", summary.simulated_seconds));
  print("steps per second",
        fmt::format("{:.0f}{}", mean > 0 ? 1 / mean : 0, summary.bodies > 1 ? " over all bodies" : ""));
  print("mean step time", microseconds(mean));
  print("median step time", microseconds(summary.step_seconds.quantile(0.5)));
  print("95 percent step time", microseconds(summary.step_seconds.quantile(0.95)));
  print("real-time factor", fmt::format("{:.1f}", mean > 0 ? config.time_step / (mean * summary.bodies) : 0));
  print("Newton iterations", fmt::format("{:.2f} a step", summary.newton_iterations.mean()));
  if (runs_examples(loaded.scene))
    print("target iterations", fmt::format("{:.2f} a step", summary.target_iterations.mean()));
  print("projections", std::to_string(summary.projections));
  print("unconverged steps", std::to_string(summary.unconverged_steps));
  print("kinetic energy", fmt::format("{:.6g} J", summary.energies.kinetic));
  print("elastic energy", fmt::format("{:.6g} J", summary.energies.elastic));
  print("potential energy", fmt::format("{:.6g} J", summary.energies.potential));
  if (summary.largest_displacement)
    print("largest displacement", fmt::format("{:.6g} m (over the frames written)", *summary.largest_displacement));
  print("state hash", fmt::format("{:016x}", summary.state_hash));
  if (config.trajectory) print("trajectory", config.trajectory->string());
}

void print_profile(const RunSummary& summary) {
  if (!summary.stage_seconds) return;
  fmt::print("\n{:<22} {:>12} {:>12} {:>12}\n", "stage", "mean us", "median us", "95 % us");
  for (std::size_t stage = 0; stage < kStageNames.size(); ++stage) {
    const Samples& seconds = (*summary.stage_seconds)[stage];
    fmt::print("{:<22} {:>12.2f} {:>12.2f} {:>12.2f}\n", kStageNames[stage], 1e6 * seconds.mean(),
               1e6 * seconds.quantile(0.5), 1e6 * seconds.quantile(0.95));
  }
}

}  // namespace

void run_command(const RunCommandOptions& options) {
  SceneConfig config = load_scene(options.scene);
  if (options.trajectory) config.trajectory = options.trajectory;
  if (options.steps) config.steps = *options.steps;
  const LoadedScene loaded = load_run(config);
  log_loaded(loaded, config);
  const RunSummary summary = run(loaded, config, options.run);
  if (summary.unconverged_steps > 0)
    log::warning(
        fmt::format("{} of {} steps did not reach the tolerance {:g} (target included); a smaller time_step or more "
                    "newton.max_iterations may help",
                    summary.unconverged_steps, summary.steps * summary.bodies, config.newton.tolerance));
  print_summary(summary, loaded, config);
  if (options.run.dump_state) print("state", options.run.dump_state->string());
  print_profile(summary);
}

}  // namespace exmat::runtime
