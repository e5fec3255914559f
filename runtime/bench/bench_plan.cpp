#include "runtime/bench/bench_plan.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

namespace exmat::runtime {
namespace {

constexpr std::int64_t kMostRounds = 1000;

}  // namespace

BenchPlan::BenchPlan(const BenchOptions& options, std::int64_t steps_of_scene, double step_seconds) {
  const auto affordable = std::max<std::int64_t>(std::llround(options.seconds / step_seconds), 1);
  steps = options.steps.value_or(std::min(steps_of_scene, affordable));
  rounds = std::clamp<std::int64_t>(affordable / steps, 1, kMostRounds);
}

double microseconds(double seconds) { return 1e6 * seconds; }

nlohmann::ordered_json times_to_json(const Samples& seconds) {
  return {{"median_us", microseconds(seconds.quantile(0.5))},
          {"p95_us", microseconds(seconds.quantile(0.95))},
          {"mean_us", microseconds(seconds.mean())}};
}

}  // namespace exmat::runtime
