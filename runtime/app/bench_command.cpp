#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "common/config/config.h"
#include "runtime/app/commands.h"
#include "runtime/app/loading_log.h"
#include "runtime/app/print.h"
#include "runtime/bench/bench.h"
#include "runtime/bench/world_bench.h"

namespace exmat::runtime {
namespace {

void print_times(std::string_view name, const Samples& seconds, double flops, double whole) {
  const double mean = seconds.mean();
  fmt::print("{:<16} {:>10.2f} {:>10.2f} {:>10.2f} {:>8.1f} {:>12.0f} {:>10.2f}\n", name, 1e6 * seconds.quantile(0.5),
             1e6 * seconds.quantile(0.95), 1e6 * mean, 100 * mean / whole, flops, mean > 0 ? 1e-9 * flops / mean : 0);
}

void print_stages(const BenchResult& result) {
  double whole = 0;
  for (const BenchStage& stage : result.stages) whole += stage.seconds.mean();
  fmt::print("{:<16} {:>10} {:>10} {:>10} {:>8} {:>12} {:>10}\n", "a step", "median us", "95 % us", "mean us",
             "share %", "flops", "GFLOP/s");
  for (std::size_t stage = 0; stage < kBenchStageNames.size(); ++stage)
    print_times(kBenchStageNames[stage], result.stages[stage].seconds, result.stages[stage].flops, whole);
  print_times("whole step", result.step_seconds, result.flops(), result.step_seconds.mean());
}

void print_scene(const BenchResult& result) {
  print("model", fmt::format("r = {}, s = {}, K = {} ({} tets, which no step sees)", result.modes, result.elements,
                             result.examples, result.tets));
  print("internal force", result.internal_force);
  print("target", result.target);
  print("integrator", fmt::format("{}, time step {:g} s", result.integrator, result.time_step));
  print("steps", fmt::format("{} from rest, {} times", result.steps, result.rounds));
  print("bodies, threads", fmt::format("{}, {}", result.instances, result.threads));
  print("instruction set", result.instruction_set);
}

void print_rates(const BenchResult& result) {
  print("Newton iterations",
        fmt::format("{:.2f} a step, {:.2f} factorisations", result.newton_iterations, result.factorisations));
  if (result.target_iterations > 0) print("target iterations", fmt::format("{:.2f} a step", result.target_iterations));
  print("steps per second",
        fmt::format("{:.0f}{}", result.steps_per_second(), result.instances > 1 ? " over all bodies" : ""));
  print("real-time factor", fmt::format("{:.1f}", result.real_time_factor()));
  print("bytes touched", fmt::format("{:.0f} a step", result.bytes));
  print("achieved", fmt::format("{:.2f} GFLOP/s", 1e-9 * result.flops_per_second()));
  print("DGEMM", fmt::format("{:.2f} GFLOP/s in one thread, best of this run; median {:.2f}",
                             1e-9 * result.dgemm_flops_per_second, 1e-9 * result.dgemm_median_per_second));
  print("limit", fmt::format("{:.2f} us a step: its flops at the DGEMM rate", 1e6 * result.limit_seconds()));
  print("limit ratio", fmt::format("{:.2f}: the median step takes so many times the limit", result.limit_ratio()));
  print("state hash", fmt::format("{:016x}", result.state_hash));
}

void print_world(const WorldBenchResult& result) {
  for (const WorldBenchResult::Kind& kind : result.kinds)
    print(kind.name.c_str(),
          fmt::format("{}, r = {}, s = {}, {} vertices against {} triangles",
                      kind.bodies == 1 ? std::string("a body") : fmt::format("{} bodies", kind.bodies), kind.modes,
                      kind.elements, kind.vertices, kind.triangles));
  print("integrator", fmt::format("{}, time step {:g} s", result.integrator, result.time_step));
  print("steps", fmt::format("{} from rest, {} times", result.steps, result.rounds));
  print("bodies, threads", fmt::format("{}, {}", result.bodies, result.threads));
  print("instruction set", result.instruction_set);
  fmt::print("\n{:<16} {:>10} {:>10} {:>10} {:>8}\n", "a body's step", "median us", "95 % us", "mean us", "share %");
  const auto print_row = [&](std::string_view name, const Samples& seconds) {
    fmt::print("{:<16} {:>10.2f} {:>10.2f} {:>10.2f} {:>8.1f}\n", name, 1e6 * seconds.quantile(0.5),
               1e6 * seconds.quantile(0.95), 1e6 * seconds.mean(), 100 * seconds.mean() / result.step_seconds.mean());
  };
  for (std::size_t stage = 0; stage < kWorldStageNames.size(); ++stage)
    print_row(kWorldStageNames[stage], result.stages[stage]);
  print_row("whole step", result.step_seconds);
  fmt::print("\n");
  print("touching pairs", fmt::format("{:.1f} a step, at most {}", result.touching_pairs, result.most_pairs));
  print("islands", fmt::format("{:.1f} a step, the largest of {} bodies", result.islands, result.largest_island));
  print("unconverged islands", std::to_string(result.unconverged_islands));
  print("Newton iterations", fmt::format("{:.2f} a step", result.newton_iterations));
  print("steps per second", fmt::format("{:.0f} over all bodies", result.steps_per_second()));
  print("real-time factor", fmt::format("{:.2f}", result.real_time_factor()));
  print("state hash", fmt::format("{:016x}", result.state_hash));
}

void bench_world(WorldConfig config, const BenchCommandOptions& options) {
  config.trajectory.reset();
  for (BodiesConfig& bodies : config.bodies) bodies.scene.trajectory.reset();
  for (const BodiesConfig& bodies : config.bodies) require_bundle(bodies.scene);
  const LoadedWorld loaded = load_world_run(config);
  log_loaded(loaded, config);
  const WorldBenchResult result = bench(loaded, config, {.steps = options.steps});
  if (options.json)
    fmt::print("{}\n", to_json(result).dump(2));
  else
    print_world(result);
}

}  // namespace

void bench_command(const BenchCommandOptions& options) {
  if (std::optional<WorldConfig> world = load_world(options.scene)) return bench_world(std::move(*world), options);
  SceneConfig config = load_scene(options.scene);
  config.trajectory.reset();
  require_bundle(config);
  const LoadedScene loaded = load_run(config);
  log_loaded(loaded, config);
  const BenchResult result = bench(loaded, config, {.steps = options.steps});
  if (options.json) {
    fmt::print("{}\n", to_json(result).dump(2));
    return;
  }
  print_scene(result);
  fmt::print("\n");
  print_stages(result);
  fmt::print("\n");
  print_rates(result);
}

}  // namespace exmat::runtime
