#include "precompute/study/worlds/world_runs.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <utility>

#include "common/core/error.h"
#include "common/core/progress.h"
#include "common/core/timer.h"
#include "precompute/study/measure/runs.h"
#include "runtime/scene/bodies.h"
#include "runtime/scene/samples.h"
#include "runtime/scene/world_loader.h"

namespace exmat::precompute {
namespace {

constexpr double kRoundSeconds = 0.25;     // of one point in one round
constexpr std::int64_t kFewestSteps = 20;  // in any case

[[noreturn]] void fail_non_finite(std::int64_t step, double time) {
  throw WorkError(
      fmt::format("step {} (time {:g} s): a number that is not finite; try a smaller time step", step, time));
}

void add_energies(const runtime::Energies& now, BodyFrames& frames) {
  frames.kinetic.push_back(now.kinetic);
  frames.elastic.push_back(now.elastic);
  frames.potential.push_back(now.potential);
}

/// Outcome of one step.
struct StepCount {
  bool unconverged = false, non_finite = false;
  int newton_iterations = 0, factorisations = 0;
};

/// Takes steps and records frames; `take` makes one step of all bodies, `record(i, frames)` adds a frame of a body.
template <typename Take, typename Record>
void run(double time_step, const std::vector<double>& times, const Take& take, const Record& record, WorldRun& result) {
  const std::int64_t all = std::llround(times.back() / time_step);
  runtime::Samples seconds(all);
  BodyFrames counted;
  counted.times = times;
  result.bodies.resize(result.names.size());
  Progress progress("steps", all);
  for (const double time : times) {
    const std::int64_t until = std::llround(time / time_step);
    while (counted.steps < until) {
      const Timer timer;
      const StepCount step = take();
      seconds.add(timer.seconds());
      ++counted.steps;
      counted.unconverged += step.unconverged;
      counted.newton_iterations += step.newton_iterations;
      counted.factorisations += step.factorisations;
      if (step.non_finite) fail_non_finite(counted.steps, time);
      progress.advance();
    }
    for (std::size_t i = 0; i < result.bodies.size(); ++i) record(i, result.bodies[i]);
  }
  for (BodyFrames& frames : result.bodies) {
    frames.times = times;
    frames.steps = counted.steps;
    frames.unconverged = counted.unconverged;
    frames.newton_iterations = counted.newton_iterations / static_cast<double>(counted.steps);
    frames.factorisations = counted.factorisations / static_cast<double>(counted.steps);
    frames.step_seconds = seconds.quantile(0.5);
  }
}

}  // namespace

WorldRun run_world(const WorldConfig& config, const std::vector<double>& times) {
  const runtime::LoadedWorld loaded = runtime::load_world_run(config);
  runtime::Bodies bodies(loaded, config);
  runtime::World& world = bodies.world();
  WorldRun result;
  for (const runtime::LoadedBody& body : loaded.bodies) {
    result.names.push_back(body.name);
    result.kinds.push_back(body.kind);
  }
  for (const runtime::LoadedKind& kind : loaded.kinds) {
    result.modes.push_back(static_cast<std::size_t>(kind.loaded.model->modes()));
    result.elements.push_back(static_cast<std::size_t>(kind.loaded.summary.cubature_elements));
  }
  const auto take = [&] {
    const runtime::WorldReport report = world.step(1);
    StepCount step{.unconverged = report.unconverged_islands > 0, .newton_iterations = report.newton_iterations};
    for (int i = 0; i < world.count(); ++i) {
      step.unconverged |= (world.report(i).status & runtime::kStepUnconverged) != 0;
      step.non_finite |= (world.report(i).status & runtime::kStepNonFinite) != 0;
      step.factorisations = std::max(step.factorisations, world.report(i).factorisations);
    }
    return step;
  };
  const auto record = [&](std::size_t i, BodyFrames& frames) {
    const auto body = static_cast<int>(i);
    const runtime::LoadedScene& kind = loaded.kinds[loaded.bodies[i].kind].loaded;
    WorldFrame now = world_frame(kind.data, *kind.model->frame, world.state(body), kind.full.get());
    frames.positions.push_back(std::move(now.positions));
    frames.velocities.push_back(std::move(now.velocities));
    add_energies(world.energies(body), frames);
  };
  run(config.time_step, times, take, record, result);
  return result;
}

WorldRun run_full_space_world(WorldConfig config, const std::vector<double>& times) {
  for (BodiesConfig& bodies : config.bodies) bodies.scene.space = {.space = Space::kFull, .newton = {50, 1e-8}};
  return run_world(config, times);
}

std::vector<StepTimes> time_worlds(const std::vector<WorldConfig>& scenes, const TimingConfig& config) {
  std::vector<runtime::LoadedWorld> loaded;
  for (const WorldConfig& scene : scenes) loaded.push_back(runtime::load_world_run(scene));
  std::vector<runtime::Samples> samples(scenes.size(), runtime::Samples(config.rounds * config.steps));
  std::vector<StepTimes> times(scenes.size());
  Progress progress("timing", config.rounds * std::ssize(scenes));
  for (int round = 0; round < config.rounds; ++round)
    for (std::size_t i = 0; i < scenes.size(); ++i) {
      runtime::Bodies bodies(loaded[i], scenes[i]);
      runtime::World& world = bodies.world();
      const Timer all;
      for (std::int64_t step = 0; step < config.steps; ++step) {
        if (step >= kFewestSteps && all.seconds() > kRoundSeconds) break;
        const Timer timer;
        world.step(1);
        samples[i].add(timer.seconds() / world.count());
        ++times[i].steps;
      }
      progress.advance();
    }
  for (std::size_t i = 0; i < scenes.size(); ++i) {
    times[i].median = samples[i].quantile(0.5);
    times[i].p95 = samples[i].quantile(0.95);
  }
  return times;
}

BodyFrames all_of(const WorldRun& run) {
  BodyFrames all = run.bodies.front();
  for (std::size_t f = 0; f < all.times.size(); ++f) {
    Eigen::Index rows = 0;
    for (const BodyFrames& body : run.bodies) rows += body.positions[f].rows();
    VertexArray positions(rows, 3), velocities(rows, 3);
    all.kinetic[f] = all.elastic[f] = all.potential[f] = 0;
    rows = 0;
    for (const BodyFrames& body : run.bodies) {
      const Eigen::Index own = body.positions[f].rows();
      positions.middleRows(rows, own) = body.positions[f];
      velocities.middleRows(rows, own) = body.velocities[f];
      all.kinetic[f] += body.kinetic[f];
      all.elastic[f] += body.elastic[f];
      all.potential[f] += body.potential[f];
      rows += own;
    }
    all.positions[f] = std::move(positions);
    all.velocities[f] = std::move(velocities);
  }
  return all;
}

}  // namespace exmat::precompute
