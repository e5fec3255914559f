#include "runtime/scene/world_run.h"

#include <algorithm>

#include "common/core/progress.h"
#include "common/core/timer.h"
#include "runtime/output/trajectory.h"
#include "runtime/scene/contact_load.h"
#include "runtime/scene/world_bodies.h"
#include "runtime/scene/world_state_file.h"

namespace exmat::runtime {
namespace {

std::unique_ptr<WorldTrajectoryWriter> open_trajectory(const LoadedWorld& loaded, const WorldConfig& config) {
  if (!config.trajectory) return nullptr;
  std::vector<NamedBody> bodies;
  for (const LoadedBody& body : loaded.bodies) {
    const LoadedScene& kind = loaded.kinds[body.kind].loaded;
    SceneConfig scene = config.bodies[body.kind].scene;
    scene.trajectory = config.trajectory;
    scene.steps = config.steps;
    bodies.push_back({body.name, kind.data, *kind.model->frame, trajectory_info(kind, scene)});
  }
  return std::make_unique<WorldTrajectoryWriter>(*config.trajectory, bodies);
}

double deepest_of(const World& world) {
  double deepest = 0;
  for (const HeldPair& pair : world.held())
    for (const auto& side : pair.held)
      for (const HeldBodyContact& contact : side) deepest = std::max(deepest, -contact.gap);
  return deepest;
}

void add(const WorldReport& report, const World& world, double seconds, WorldSummary& summary) {
  ++summary.steps;
  summary.step_seconds.add(seconds / world.count());
  summary.newton_iterations.add(report.newton_iterations);
  summary.touching_pairs.add(report.touching_pairs);
  summary.most_pairs = std::max(summary.most_pairs, report.touching_pairs);
  summary.largest_island = std::max(summary.largest_island, report.largest_island);
  summary.unconverged_islands += report.unconverged_islands;
  for (int i = 0; i < world.count(); ++i)
    if (world.report(i).status & kStepUnconverged) ++summary.unconverged_steps;
}

void add_profile(const WorldProfile& profile, double whole, double output, int bodies, WorldStageSamples& stages) {
  double staged = 0;
  for (std::size_t stage = 0; stage < kWorldStageNames.size(); ++stage) {
    if (stage == static_cast<std::size_t>(WorldStage::kOther)) continue;
    staged += profile.seconds[stage];
    stages.step[stage].add(profile.seconds[stage] / bodies);
  }
  stages.step[static_cast<std::size_t>(WorldStage::kOther)].add(std::max(0.0, whole - staged) / bodies);
  stages.output.add(output / bodies);
}

WorldSummary empty_summary(std::int64_t steps, const WorldBodies& bodies, bool profiled) {
  WorldSummary summary;
  summary.bodies = bodies.count();
  summary.threads = bodies.threads();
  summary.step_seconds = summary.newton_iterations = summary.touching_pairs = Samples(steps);
  summary.start = bodies.world().energies();
  if (!profiled) return summary;
  WorldStageSamples& stages = summary.stage_seconds.emplace();
  stages.step.fill(Samples(steps));
  stages.output = Samples(steps);
  return summary;
}

std::vector<PressedBody> most_pressed_of(const LoadedWorld& loaded, const World& world) {
  std::vector<BodyTouch> touches;
  world.read_touches(touches);
  std::vector<PressedBody> most(loaded.kinds.size());
  for (int i = 0; i < world.count(); ++i) {
    const std::size_t kind = loaded.bodies[static_cast<std::size_t>(i)].kind;
    Eigen::VectorXd load = Eigen::VectorXd::Zero(3 * loaded.kinds[kind].loaded.summary.vertices);
    add_contact_load(world.model(i), world.state(i), world.workspace(i), load);
    const Eigen::Matrix3d to_own = world.model(i).frame->placement(world.state(i).frame).rotation.transpose();
    for (const BodyTouch& touch : touches)
      if (touch.body == i) load.segment<3>(3 * static_cast<Eigen::Index>(touch.vertex)) += to_own * touch.force;
    const double force = load.reshaped(3, load.size() / 3).colwise().norm().sum();
    if (force > most[kind].force) most[kind] = {i, force, std::move(load)};
  }
  return most;
}

}  // namespace

WorldSummary run(const LoadedWorld& loaded, const WorldConfig& config, const RunOptions& options) {
  WorldBodies bodies(loaded, config);
  const World& world = bodies.world();
  if (options.from_state) bodies.take_up(read_world_state(*options.from_state, loaded, config));
  WorldSummary summary = empty_summary(config.steps, bodies, options.profiled);
  const auto trajectory = open_trajectory(loaded, config);
  const auto append = [&](double seconds) {
    for (int i = 0; i < world.count(); ++i)
      trajectory->append(static_cast<std::size_t>(i), world.state(i),
                         energies(world.model(i), world.scene(i), world.state(i)), seconds);
  };
  if (trajectory) append(0);
  WorldMemory before;  // the step, for the state file of one that fails
  Progress progress("steps", config.steps);
  while (summary.steps < config.steps) {
    if (options.dump_state) bodies.remember(before);
    WorldProfile profile;
    bodies.set_profile(options.profiled ? &profile : nullptr);
    const Timer timer;
    const WorldReport report = bodies.step();
    const double seconds = timer.seconds();
    if (options.dump_state && !bodies.is_finite()) write_world_state(before, loaded, config, *options.dump_state);
    bodies.require_finite();
    add(report, world, seconds, summary);
    const Timer output;
    const bool written = trajectory && summary.steps % config.every == 0;
    if (written) append(seconds / world.count());
    if (options.profiled)
      add_profile(profile, seconds, written ? output.seconds() : 0, world.count(), *summary.stage_seconds);
    progress.advance();
  }
  if (trajectory) {
    trajectory->finish();
    summary.largest_displacement = trajectory->largest_displacement();
  }
  if (options.dump_state) {
    bodies.remember(before);
    write_world_state(before, loaded, config, *options.dump_state);
  }
  summary.simulated_seconds = static_cast<double>(config.steps) * config.time_step;
  summary.end = world.energies();
  summary.deepest = deepest_of(world);
  if (options.keeps_contacts) summary.most_pressed = most_pressed_of(loaded, world);
  summary.state_hash = bodies.hash();
  return summary;
}

}  // namespace exmat::runtime
