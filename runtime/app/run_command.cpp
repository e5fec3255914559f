#include <algorithm>
#include <cmath>
#include <fmt/format.h>

#include "common/bundle/file_schemas.h"
#include "common/config/config.h"
#include "common/core/command_files.h"
#include "common/core/error.h"
#include "common/core/log.h"
#include "common/core/number_limits.h"
#include "common/hdf5/xdmf.h"
#include "runtime/app/commands.h"
#include "runtime/app/loading_log.h"
#include "runtime/app/lost_work.h"
#include "runtime/app/print.h"
#include "runtime/scene/scene_run.h"
#include "runtime/scene/state_file.h"

namespace exmat::runtime {
namespace {

std::string microseconds(double seconds) { return fmt::format("{:.2f} us", 1e6 * seconds); }

bool may_touch_each_other(const LoadedWorld& loaded) {
  return std::ranges::any_of(loaded.kinds, [](const LoadedKind& kind) { return kind.surface != nullptr; });
}

std::string body_name(const LoadedWorld& loaded, int body) {
  const std::string& name = loaded.bodies[static_cast<std::size_t>(body)].name;
  return name.empty() ? fmt::format("body {}", body) : fmt::format("body \"{}\"", name);
}

void print_times(const RunSummary& summary, const WorldConfig& config) {
  const bool several = summary.bodies > 1;
  const double mean = summary.step_seconds.mean();
  const std::string a_body = several ? " a body" : "";
  print("simulated time", fmt::format("{:g} s", summary.simulated_seconds));
  print("steps per second", fmt::format("{:.0f}{}", mean > 0 ? 1 / mean : 0, several ? " over all bodies" : ""));
  print("mean step time", microseconds(mean) + a_body);
  print("median step time", microseconds(summary.step_seconds.quantile(0.5)) + a_body);
  print("95 percent step time", microseconds(summary.step_seconds.quantile(0.95)) + a_body);
  print("real-time factor", fmt::format("{:.1f}", mean > 0 ? config.time_step / (mean * summary.bodies) : 0));
}

void print_summary(const RunSummary& summary, const LoadedWorld& loaded, const WorldConfig& config) {
  const bool touches = may_touch_each_other(loaded);
  const auto any_kind = [&](const auto& holds) { return std::ranges::any_of(loaded.kinds, holds); };
  print("steps", std::to_string(summary.steps));
  if (summary.bodies > 1) {
    print("bodies", std::to_string(summary.bodies) + (config.is_list ? "" : " (the trajectory is that of the first)"));
    print("threads", std::to_string(summary.threads));
  }
  print_times(summary, config);
  if (touches) {
    print("touching pairs",
          fmt::format("{:.1f} a step, at most {}", summary.touching_pairs.mean(), summary.most_pairs));
    print("largest island", fmt::format("{} bodies solved together", summary.largest_island));
    print("unconverged islands", std::to_string(summary.unconverged_islands));
  }
  print("Newton iterations", fmt::format("{:.2f} a step", summary.newton_iterations.mean()));
  if (any_kind([](const LoadedKind& kind) { return runs_examples(kind.loaded.scene); }))
    print("target iterations", fmt::format("{:.2f} a step", summary.target_iterations.mean()));
  print("projections", std::to_string(summary.projections));
  print("unconverged steps", std::to_string(summary.unconverged_steps));
  if (summary.divided_steps > 0) print("divided steps", std::to_string(summary.divided_steps));
  if (any_kind([](const LoadedKind& kind) { return kind.loaded.scene.sleep.energy > 0; }))
    print("steps asleep", fmt::format("{} of {}", summary.slept_steps, summary.steps * summary.bodies));
  print("kinetic energy", fmt::format("{:.6g} J", summary.end.kinetic));
  print("elastic energy", fmt::format("{:.6g} J", summary.end.elastic));
  print("potential energy", fmt::format("{:.6g} J", summary.end.potential));
  if (touches) {
    print("contact energy", fmt::format("{:.6g} J", summary.end.contact));
    print("energy at the start", fmt::format("{:.6g} J", summary.start.total()));
    print("deepest contact", fmt::format("{:.3g} m between bodies at the end", summary.deepest));
  }
  for (const BrokenAttachment& broken : summary.broken)
    print("broken attachment", fmt::format("{} of {} at {:g} s, under {:.4g} N", broken.place,
                                           body_name(loaded, broken.body), broken.time, broken.force));
  if (summary.farthest_reach)
    print("reach", fmt::format("{:.3g} m from its place, the farthest point at the end", *summary.farthest_reach));
  if (summary.largest_displacement)
    print("largest displacement", fmt::format("{:.6g} m (over the frames written)", *summary.largest_displacement));
  print("state hash", fmt::format("{:016x}", summary.state_hash));
  if (config.trajectory) print("trajectory", config.trajectory->string());
  print_origin(summary.origin, "which the trajectory's positions are measured from: its attribute \"origin\"");
}

void print_stage_heading() {
  fmt::print("\n{:<22} {:>12} {:>12} {:>12}\n", "stage", "mean us", "median us", "95 % us");
}

void print_stage(std::string_view name, const Samples& seconds) {
  fmt::print("{:<22} {:>12.2f} {:>12.2f} {:>12.2f}\n", name, 1e6 * seconds.mean(), 1e6 * seconds.quantile(0.5),
             1e6 * seconds.quantile(0.95));
}

void print_profile(const RunSummary& summary, bool touches) {
  if (!summary.stage_seconds) return;
  print_stage_heading();
  for (std::size_t stage = 0; stage < kStageNames.size(); ++stage)
    print_stage(kStageNames[stage], summary.stage_seconds->of_bodies[stage]);
  if (!touches) return;
  for (std::size_t stage = 0; stage < kWorldStageNames.size(); ++stage)
    print_stage(kWorldStageNames[stage], summary.stage_seconds->of_world[stage]);
}

std::string trajectory_role(const RunCommandOptions& options) {
  return options.trajectory ? "-o" : "output.trajectory of the scene";
}

void claim_outputs(const WorldConfig& config, const RunCommandOptions& options) {
  if (config.trajectory) claim_trajectory(*config.trajectory, trajectory_role(options));
  if (options.run.dump_state) claim_output(*options.run.dump_state, "--dump-state");
  if (options.run.from_state) check_input(*options.run.from_state, "a state file");
}

/// Once all inputs are known: nothing else than earlier outputs is replaced.
void require_kinds(const WorldConfig& config, const RunCommandOptions& options) {
  if (config.trajectory) require_trajectory_kind(*config.trajectory, trajectory_role(options), trajectory_schema());
  if (options.run.dump_state) require_kind(*options.run.dump_state, "--dump-state", "a state file", kStateBeginning);
}

void warn_of_steps(const RunSummary& summary, const WorldConfig& config) {
  if (summary.divided_steps > 0)
    log::info(fmt::format("{} of {} steps had no solution and were taken in several smaller ones",
                          summary.divided_steps, summary.steps * summary.bodies));
  if (summary.unconverged_islands > 0)
    log::warning(
        fmt::format("{} solutions of bodies that touch did not reach the tolerance; a smaller time_step or "
                    "contact stiffness may help",
                    summary.unconverged_islands));
  else if (summary.unconverged_steps > 0)
    log::warning(fmt::format(
        "{} of {} steps did not reach the tolerance {:g} (target included); a smaller time_step or more "
        "newton.max_iterations may help",
        summary.unconverged_steps, summary.steps * summary.bodies, config.bodies.front().scene.newton.tolerance));
}

/// The length of a bar of its mass and inertia, if it has any, else that of the surface that may touch; where neither
/// is known a metre [m].
double length_of(const Model& model) {
  if (const DeformingInertia* const inertia = model.frame->inertia_of_momenta()) {
    DeformingInertia::Moments moments = inertia->make_moments();
    inertia->moments(Eigen::VectorXd::Zero(inertia->modes()), moments);
    return std::sqrt(6 * moments.inertia.trace() / inertia->mass());
  }
  return model.contact ? 2 * model.contact->reach() : 1;
}

/// Names the farthest body that begins where doubles do not hold its shape.
void warn_of_places(const LoadedWorld& loaded) {
  std::vector<double> lengths;
  for (const LoadedKind& kind : loaded.kinds) lengths.push_back(length_of(*kind.loaded.model));
  int farthest = -1;
  double far = 0, gap = 0;
  for (std::size_t i = 0; i < loaded.bodies.size(); ++i) {
    const LoadedBody& body = loaded.bodies[i];
    const LoadedScene& kind = loaded.kinds[body.kind].loaded;
    const Eigen::Vector3d start = kind.model->frame->placement(kind.start.frame).position + body.place.position;
    const double own = start.cwiseAbs().maxCoeff(), lost = lost_detail(own, lengths[body.kind]);
    if (lost == 0 || own <= far) continue;
    farthest = static_cast<int>(i);
    far = own;
    gap = lost;
  }
  if (farthest >= 0)
    log::warning(fmt::format(
        "{} starts {:.3g} m from the origin, where numbers of 16 digits are {:.1g} m apart: finer detail of its shape "
        "is lost; move the scene to the origin",
        body_name(loaded, farthest), far, gap));
}

void warn_of_overlap(const RunSummary& summary, const LoadedWorld& loaded, const WorldConfig& config) {
  if (!summary.overlap) return;
  const auto name_of = [&](int body) { return body_name(loaded, body); };
  const StartOverlap& overlap = *summary.overlap;
  log::warning(fmt::format(
      "{} starts {:.3g} m inside {} (its vertex {}): what overlaps at the start is let out at {:g} m/s "
      "(contact.release)",
      name_of(overlap.body), overlap.depth,
      overlap.is_obstacle ? fmt::format("obstacle {} of those that it meets", overlap.other) : name_of(overlap.other),
      overlap.vertex, config.contact.release));
}

}  // namespace

void run_command(const RunCommandOptions& options) {
  WorldConfig config = load_world(options.scene);
  if (options.trajectory) set_trajectory(*options.trajectory, config);
  if (options.steps) config.steps = *options.steps;
  claim_outputs(config, options);
  const LoadedWorld loaded = load_world_run(config);
  require_kinds(config, options);
  log_loaded(loaded, config);
  warn_of_places(loaded);
  RunOptions run_options = options.run;
  run_options.keeps_contacts = true;
  const RunSummary summary = run(loaded, config, run_options);
  warn_of_overlap(summary, loaded, config);
  warn_of_steps(summary, config);
  print_summary(summary, loaded, config);
  print_lost_work(summary, loaded, config, options.load_capacity);
  if (options.run.dump_state) print("state", options.run.dump_state->string());
  print_profile(summary, may_touch_each_other(loaded));
}

}  // namespace exmat::runtime
