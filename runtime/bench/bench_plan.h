#pragma once

#include <cstdint>
#include <nlohmann/json_fwd.hpp>

#include "runtime/bench/bench.h"

namespace exmat::runtime {

inline constexpr double kWarmUpShare = 0.1;  ///< share of the time to measure

/// Numbers of steps and rounds of a scene that are measured.
struct BenchPlan {
  std::int64_t steps = 1, rounds = 1;

  /// Rounds of `steps_of_scene` steps that take `step_seconds` each, or of as many as are asked for.
  BenchPlan(const BenchOptions& options, std::int64_t steps_of_scene, double step_seconds);
  std::int64_t samples() const { return steps * rounds; }
};

double microseconds(double seconds);

/// Median, 95th percentile and mean.
nlohmann::ordered_json times_to_json(const Samples& seconds);

}  // namespace exmat::runtime
