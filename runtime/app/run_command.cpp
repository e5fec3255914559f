#include <fmt/format.h>

#include "common/config/config.h"
#include "common/core/command_files.h"
#include "common/core/error.h"
#include "common/core/log.h"
#include "common/hdf5/xdmf.h"
#include "runtime/app/commands.h"
#include "runtime/app/loading_log.h"
#include "runtime/app/lost_work.h"
#include "runtime/app/print.h"
#include "runtime/scene/scene_run.h"
#include "runtime/scene/world_run.h"

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
  if (loaded.scene.sleep.energy > 0)
    print("steps asleep", fmt::format("{} of {}", summary.slept_steps, summary.steps * summary.bodies));
  print("kinetic energy", fmt::format("{:.6g} J", summary.energies.kinetic));
  print("elastic energy", fmt::format("{:.6g} J", summary.energies.elastic));
  print("potential energy", fmt::format("{:.6g} J", summary.energies.potential));
  if (summary.largest_displacement)
    print("largest displacement", fmt::format("{:.6g} m (over the frames written)", *summary.largest_displacement));
  print("state hash", fmt::format("{:016x}", summary.state_hash));
  if (config.trajectory) print("trajectory", config.trajectory->string());
}

void print_stage_heading() {
  fmt::print("\n{:<22} {:>12} {:>12} {:>12}\n", "stage", "mean us", "median us", "95 % us");
}

void print_stage(std::string_view name, const Samples& seconds) {
  fmt::print("{:<22} {:>12.2f} {:>12.2f} {:>12.2f}\n", name, 1e6 * seconds.mean(), 1e6 * seconds.quantile(0.5),
             1e6 * seconds.quantile(0.95));
}

void print_profile(const RunSummary& summary) {
  if (!summary.stage_seconds) return;
  print_stage_heading();
  for (std::size_t stage = 0; stage < kStageNames.size(); ++stage)
    print_stage(kStageNames[stage], (*summary.stage_seconds)[stage]);
}

void print_profile(const WorldSummary& summary) {
  if (!summary.stage_seconds) return;
  print_stage_heading();
  for (std::size_t stage = 0; stage < kWorldStageNames.size(); ++stage)
    print_stage(kWorldStageNames[stage], summary.stage_seconds->step[stage]);
  print_stage("output", summary.stage_seconds->output);
}

void print_world(const WorldSummary& summary, const WorldConfig& config) {
  const double mean = summary.step_seconds.mean();
  print("bodies", std::to_string(summary.bodies));
  print("threads", std::to_string(summary.threads));
  print("steps", std::to_string(summary.steps));
  print("simulated time", fmt::format("{:g} s", summary.simulated_seconds));
  print("body-steps per second", fmt::format("{:.0f}", mean > 0 ? 1 / mean : 0));
  print("mean step time", microseconds(mean) + " a body");
  print("median step time", microseconds(summary.step_seconds.quantile(0.5)) + " a body");
  print("95 percent step time", microseconds(summary.step_seconds.quantile(0.95)) + " a body");
  print("real-time factor", fmt::format("{:.2f}", mean > 0 ? config.time_step / (mean * summary.bodies) : 0));
  print("touching pairs", fmt::format("{:.1f} a step, at most {}", summary.touching_pairs.mean(), summary.most_pairs));
  print("largest island", fmt::format("{} bodies solved together", summary.largest_island));
  print("Newton iterations", fmt::format("{:.2f} a step, most of an island", summary.newton_iterations.mean()));
  print("unconverged islands", std::to_string(summary.unconverged_islands));
  print("unconverged steps", std::to_string(summary.unconverged_steps));
  print("kinetic energy", fmt::format("{:.6g} J", summary.end.kinetic));
  print("elastic energy", fmt::format("{:.6g} J", summary.end.elastic));
  print("potential energy", fmt::format("{:.6g} J", summary.end.potential));
  print("energy at the start", fmt::format("{:.6g} J", summary.start.total()));
  print("deepest contact", fmt::format("{:.3g} m between bodies at the end", summary.deepest));
  if (summary.largest_displacement)
    print("largest displacement", fmt::format("{:.6g} m (over the frames written)", *summary.largest_displacement));
  print("state hash", fmt::format("{:016x}", summary.state_hash));
  if (config.trajectory) print("trajectory", config.trajectory->string());
}

void claim_outputs(const std::optional<std::filesystem::path>& trajectory, const RunCommandOptions& options) {
  if (trajectory) claim_trajectory(*trajectory, options.trajectory ? "-o" : "output.trajectory of the scene");
  if (options.run.dump_state) claim_output(*options.run.dump_state, "--dump-state");
  if (options.run.from_state) check_input(*options.run.from_state, "a state file");
}

RunOptions run_options(const RunCommandOptions& options) {
  RunOptions run = options.run;
  run.keeps_contacts = true;
  return run;
}

void run_world(WorldConfig config, const RunCommandOptions& options) {
  if (options.trajectory) config.trajectory = options.trajectory;
  if (options.steps) config.steps = *options.steps;
  claim_outputs(config.trajectory, options);
  for (const BodiesConfig& bodies : config.bodies) require_bundle(bodies.scene);
  const LoadedWorld loaded = load_world_run(config);
  log_loaded(loaded, config);
  const WorldSummary summary = run(loaded, config, run_options(options));
  if (summary.unconverged_islands > 0)
    log::warning(
        fmt::format("{} solutions of bodies that touch did not reach the tolerance; a smaller time_step or "
                    "contact stiffness may help",
                    summary.unconverged_islands));
  print_world(summary, config);
  print_lost_work(summary, loaded, config, options.load_capacity);
  if (options.run.dump_state) print("state", options.run.dump_state->string());
  print_profile(summary);
}

}  // namespace

void run_command(const RunCommandOptions& options) {
  if (std::optional<WorldConfig> world = load_world(options.scene)) return run_world(std::move(*world), options);
  SceneConfig config = load_scene(options.scene);
  if (options.trajectory) config.trajectory = options.trajectory;
  if (options.steps) config.steps = *options.steps;
  claim_outputs(config.trajectory, options);
  require_bundle(config);
  const LoadedScene loaded = load_run(config);
  log_loaded(loaded, config);
  const RunSummary summary = run(loaded, config, run_options(options));
  if (summary.unconverged_steps > 0)
    log::warning(
        fmt::format("{} of {} steps did not reach the tolerance {:g} (target included); a smaller time_step or more "
                    "newton.max_iterations may help",
                    summary.unconverged_steps, summary.steps * summary.bodies, config.newton.tolerance));
  print_summary(summary, loaded, config);
  print_lost_work(summary, config, options.load_capacity);
  if (options.run.dump_state) print("state", options.run.dump_state->string());
  print_profile(summary);
}

}  // namespace exmat::runtime
