#include "runtime/scene/world_run.h"

#include <algorithm>
#include <fmt/format.h>
#include <omp.h>

#include "common/core/error.h"
#include "common/core/fnv_hash.h"
#include "common/core/progress.h"
#include "common/core/timer.h"
#include "runtime/output/trajectory.h"
#include "runtime/scene/bodies.h"
#include "runtime/scene/scene_run.h"

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

void require_finite(const World& world, const LoadedWorld& loaded, const WorldConfig& config) {
  for (int i = 0; i < world.count(); ++i) {
    if (!(world.report(i).status & kStepNonFinite)) continue;
    const State& state = world.state(i);
    throw WorkError(
        fmt::format("{}: step {} (t = {:g} s), body {}: the state is no longer finite; try a smaller time_step (now "
                    "{:g} s), smaller "
                    "loads, contact or example stiffness. No trajectory was written",
                    config.file.string(), state.step + 1, state.time + config.time_step,
                    loaded.bodies[static_cast<std::size_t>(i)].name, config.time_step));
  }
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

}  // namespace

WorldSummary run(const LoadedWorld& loaded, const WorldConfig& config) {
  World world = make_world(loaded, config);
  WorldSummary summary;
  summary.bodies = world.count();
  summary.threads = std::min(omp_get_max_threads(), omp_get_num_procs());
  summary.step_seconds = summary.newton_iterations = summary.touching_pairs = Samples(config.steps);
  summary.start = world.energies();
  const auto trajectory = open_trajectory(loaded, config);
  const auto append = [&](double seconds) {
    for (int i = 0; i < world.count(); ++i)
      trajectory->append(static_cast<std::size_t>(i), world.state(i),
                         energies(world.model(i), world.scene(i), world.state(i)), seconds);
  };
  if (trajectory) append(0);
  Progress progress("steps", config.steps);
  while (summary.steps < config.steps) {
    const Timer timer;
    const WorldReport report = world.step(summary.threads);
    const double seconds = timer.seconds();
    require_finite(world, loaded, config);
    add(report, world, seconds, summary);
    if (trajectory && summary.steps % config.every == 0) append(seconds / world.count());
    progress.advance();
  }
  if (trajectory) {
    trajectory->finish();
    summary.largest_displacement = trajectory->largest_displacement();
  }
  summary.simulated_seconds = static_cast<double>(config.steps) * config.time_step;
  summary.end = world.energies();
  summary.deepest = deepest_of(world);
  FnvHash hash;
  for (int i = 0; i < world.count(); ++i) add_to_hash(world.model(i), world.state(i), hash);
  summary.state_hash = hash.value();
  return summary;
}

}  // namespace exmat::runtime
