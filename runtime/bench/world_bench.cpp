#include "runtime/bench/world_bench.h"

#include <algorithm>
#include <fmt/format.h>
#include <nlohmann/json.hpp>
#include <numeric>

#include "common/core/progress.h"
#include "common/core/timer.h"
#include "runtime/bench/bench_plan.h"
#include "runtime/scene/world_bodies.h"

namespace exmat::runtime {
namespace {

/// Sums over all steps.
struct Sums {
  double newton_iterations = 0, touching_pairs = 0, islands = 0;
};

/// Steps for so long; returns the mean time of a step of all bodies.
double warm_up(double seconds, std::int64_t steps_of_scene, WorldBodies& bodies) {
  const Timer timer;
  std::int64_t steps = 0;
  do {
    bodies.step();
    bodies.require_finite();
    if (++steps % steps_of_scene == 0) bodies.restart();
  } while (timer.seconds() < seconds);
  return timer.seconds() / static_cast<double>(steps);
}

void measure_step(WorldBodies& bodies, Sums& sums, WorldBenchResult& result) {
  WorldProfile profile;
  bodies.set_profile(&profile);
  const Timer timer;
  const WorldReport report = bodies.step();
  const double seconds = timer.seconds();
  bodies.set_profile(nullptr);
  bodies.require_finite();
  result.step_seconds.add(seconds / result.bodies);
  double& other = profile.seconds[static_cast<std::size_t>(WorldStage::kOther)];
  other = std::max(0.0, seconds - std::accumulate(profile.seconds.begin(), profile.seconds.end(), 0.0));
  for (std::size_t stage = 0; stage < profile.seconds.size(); ++stage)
    result.stages[stage].add(profile.seconds[stage] / result.bodies);
  for (int i = 0; i < result.bodies; ++i) sums.newton_iterations += bodies.world().report(i).newton_iterations;
  sums.touching_pairs += report.touching_pairs;
  sums.islands += report.islands;
  result.most_pairs = std::max(result.most_pairs, report.touching_pairs);
  result.largest_island = std::max(result.largest_island, report.largest_island);
  result.unconverged_islands += report.unconverged_islands;
}

}  // namespace

double WorldBenchResult::steps_per_second() const { return 1 / step_seconds.mean(); }

double WorldBenchResult::real_time_factor() const { return time_step / (step_seconds.mean() * bodies); }

WorldBenchResult bench(const LoadedWorld& loaded, const WorldConfig& config, const BenchOptions& options) {
  WorldBodies bodies(loaded, config);
  WorldBenchResult result;
  result.bodies = bodies.count();
  result.threads = bodies.threads();
  result.time_step = config.time_step;
  result.integrator = name_of(config.bodies.front().scene.integrator);
  result.instruction_set = kernels().name;
  for (std::size_t i = 0; i < loaded.kinds.size(); ++i) {
    const Model& model = *loaded.kinds[i].loaded.model;
    result.kinds.push_back({config.bodies[i].name, std::ssize(config.bodies[i].places), model.modes(),
                            model.internal_force.cubature().elements(), model.contact->vertices(),
                            loaded.kinds[i].surface->surface.triangles()});
  }
  const double step_seconds = warm_up(kWarmUpShare * options.seconds, config.steps, bodies);
  const BenchPlan plan(options, config.steps, step_seconds);
  result.steps = plan.steps;
  result.rounds = plan.rounds;
  const std::int64_t samples = plan.samples();
  result.step_seconds = Samples(samples);
  result.stages.fill(Samples(samples));
  Sums sums;
  Progress progress("bench", samples);
  for (std::int64_t round = 0; round < result.rounds; ++round) {
    bodies.restart();
    for (std::int64_t step = 0; step < result.steps; ++step) {
      measure_step(bodies, sums, result);
      progress.advance();
    }
  }
  result.newton_iterations = sums.newton_iterations / static_cast<double>(samples * result.bodies);
  result.touching_pairs = sums.touching_pairs / static_cast<double>(samples);
  result.islands = sums.islands / static_cast<double>(samples);
  result.state_hash = bodies.hash();
  return result;
}

nlohmann::ordered_json to_json(const WorldBenchResult& result) {
  nlohmann::ordered_json kinds = nlohmann::ordered_json::array(), stages = nlohmann::ordered_json::object();
  for (const WorldBenchResult::Kind& kind : result.kinds)
    kinds.push_back({{"name", kind.name},
                     {"instances", kind.bodies},
                     {"r", kind.modes},
                     {"s", kind.elements},
                     {"contact_vertices", kind.vertices},
                     {"triangles", kind.triangles}});
  for (std::size_t stage = 0; stage < kWorldStageNames.size(); ++stage) {
    nlohmann::ordered_json member = times_to_json(result.stages[stage]);
    member["share"] = result.stages[stage].mean() / result.step_seconds.mean();
    stages[std::string(kWorldStageNames[stage])] = std::move(member);
  }
  return {{"steps", result.steps},
          {"instances", result.bodies},
          {"step", times_to_json(result.step_seconds)},
          {"stages", stages},
          {"newton_iterations_mean", result.newton_iterations},
          {"real_time_factor", result.real_time_factor()},
          {"steps_per_second", result.steps_per_second()},
          {"touching_pairs_mean", result.touching_pairs},
          {"touching_pairs_most", result.most_pairs},
          {"islands_mean", result.islands},
          {"largest_island", result.largest_island},
          {"unconverged_islands", result.unconverged_islands},
          {"rounds", result.rounds},
          {"threads", result.threads},
          {"instruction_set", result.instruction_set},
          {"integrator", result.integrator},
          {"time_step", result.time_step},
          {"bodies", kinds},
          {"state_hash", fmt::format("{:016x}", result.state_hash)}};
}

}  // namespace exmat::runtime
