#include "runtime/scene/scene_run.h"

#include <fmt/format.h>

#include "common/core/error.h"
#include "common/core/progress.h"
#include "common/core/timer.h"
#include "runtime/scene/state_file.h"

namespace exmat::runtime {
namespace {

void add_reports(std::span<const StepReport> reports, double seconds, RunSummary& summary) {
  const auto bodies = static_cast<double>(reports.size());
  std::int64_t newton = 0, target = 0;
  for (const StepReport& report : reports) {
    newton += report.newton_iterations;
    target += report.target_iterations;
    summary.projections += report.projections;
    if ((report.status & kStepUnconverged) != 0) ++summary.unconverged_steps;
    if ((report.status & kStepAsleep) != 0) ++summary.slept_steps;
  }
  ++summary.steps;
  summary.step_seconds.add(seconds / bodies);
  summary.newton_iterations.add(static_cast<double>(newton) / bodies);
  summary.target_iterations.add(static_cast<double>(target) / bodies);
}

void add_profile(const Profile& profile, const Profile& output, int bodies,
                 std::array<Samples, kStageNames.size()>& stages) {
  for (std::size_t stage = 0; stage < stages.size(); ++stage)
    stages[stage].add(profile.seconds[stage] / bodies + output.seconds[stage]);
}

RunSummary empty_summary(std::int64_t steps, const Bodies& bodies, bool profiled) {
  RunSummary summary;
  summary.bodies = bodies.count();
  summary.threads = bodies.threads();
  summary.step_seconds = summary.newton_iterations = summary.target_iterations = Samples(steps);
  if (profiled) summary.stage_seconds.emplace().fill(Samples(steps));
  return summary;
}

void keep_hardest(const Bodies& bodies, const StepReport& report, Eigen::Index vertices, HardestContact& hardest) {
  const double force = report.contact_force.norm();
  if (bodies.count() > 1 || !(force > hardest.force)) return;
  hardest.force = force;
  hardest.time = bodies[0].time;
  hardest.load.setZero(3 * vertices);
  bodies.add_contact_load(hardest.load);
}

std::unique_ptr<TrajectoryWriter> open_trajectory(const LoadedScene& loaded, const SceneConfig& config) {
  if (!config.trajectory) return nullptr;
  return std::make_unique<TrajectoryWriter>(*config.trajectory, loaded.data, *loaded.model->frame,
                                            trajectory_info(loaded, config));
}

}  // namespace

TrajectoryInfo trajectory_info(const LoadedScene& loaded, const SceneConfig& config) {
  const std::filesystem::path folder = std::filesystem::absolute(*config.trajectory).parent_path();
  const std::string bundle =
      std::filesystem::proximate(std::filesystem::absolute(config.bundle), folder).generic_string();
  TrajectoryInfo info{std::string(name_of(config.integrator)), bundle, config.time_step,
                      1 + config.steps / config.every};
  for (std::size_t i = 0; i < loaded.scene.examples.size(); ++i) {
    const ExampleModel& examples = loaded.model->examples[i];
    if (acts(loaded.scene.examples[i])) info.weights.push_back({i, examples.region, examples.weights.examples()});
  }
  return info;
}

Bodies make_bodies(const LoadedScene& loaded, const SceneConfig& config) {
  return {*loaded.model, loaded.scene, loaded.start, config.instances, loaded.keys};
}

void require_finite(const Bodies& bodies, const SceneConfig& config) {
  const std::optional<int> body = bodies.first_non_finite();
  if (!body) return;
  const State& state = bodies[*body];
  throw WorkError(fmt::format(
      "{}: step {} (t = {:g} s), body {} of {}: the state is no longer finite; try a smaller time_step (now {:g} s), "
      "smaller loads or example stiffness, or the integrator backward_euler. No trajectory was written",
      config.file.string(), state.step + 1, state.time + config.time_step, *body + 1, bodies.count(),
      config.time_step));
}

RunSummary run(const LoadedScene& loaded, const SceneConfig& config, const RunOptions& options) {
  Bodies bodies = make_bodies(loaded, config);
  if (options.from_state) read_states(*options.from_state, loaded, bodies);
  bodies.set_profiled(options.profiled);
  const State& shown = bodies[0];
  const std::int64_t first = shown.step;
  RunSummary summary = empty_summary(config.steps, bodies, options.profiled);
  const auto trajectory = open_trajectory(loaded, config);
  const auto append = [&](double seconds) {
    trajectory->append(shown, energies(*loaded.model, bodies.scene(), shown), seconds);
  };
  if (trajectory) append(0);

  Progress progress("steps", config.steps);
  while (shown.step - first < config.steps) {
    const Timer timer;
    const std::span<const StepReport> reports = bodies.step();
    const double seconds = timer.seconds();
    if (options.dump_state && bodies.first_non_finite()) write_states(bodies, loaded, *options.dump_state);
    require_finite(bodies, config);
    add_reports(reports, seconds, summary);
    if (options.keeps_contacts) keep_hardest(bodies, reports.front(), loaded.summary.vertices, summary.hardest_contact);
    Profile output;
    if (trajectory && (shown.step - first) % config.every == 0) {
      const StageTimer stage(options.profiled ? &output : nullptr, Stage::kOutput);
      append(seconds / bodies.count());
    }
    if (options.profiled) add_profile(bodies.take_measured().profile, output, bodies.count(), *summary.stage_seconds);
    progress.advance();
  }
  if (trajectory) {
    trajectory->finish();
    summary.largest_displacement = trajectory->largest_displacement();
  }
  if (options.dump_state) write_states(bodies, loaded, *options.dump_state);
  summary.simulated_seconds = static_cast<double>(config.steps) * config.time_step;
  summary.energies = energies(*loaded.model, bodies.scene(), shown);
  summary.state_hash = bodies.hash();
  return summary;
}

}  // namespace exmat::runtime
