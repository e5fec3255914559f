#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "runtime/bench/bench.h"
#include "runtime/scene/world_run.h"

namespace exmat::runtime {

/// How long a step of several bodies takes. Times are of steps of all bodies over their number, on the wall clock.
struct WorldBenchResult {
  struct Kind {
    std::string name;
    std::int64_t bodies = 0;
    Eigen::Index modes = 0, elements = 0, vertices = 0;  ///< r, s, vertices that look for contacts
    std::int64_t triangles = 0;                          ///< of the surface that is touched
  };
  std::vector<Kind> kinds;
  std::string integrator, instruction_set;
  double time_step = 0;  ///< [s]
  std::int64_t steps = 0, rounds = 0;
  int bodies = 1, threads = 1;
  Samples step_seconds;
  std::array<Samples, kWorldStageNames.size()> stages;
  double newton_iterations = 0;            ///< mean per step of a body
  double touching_pairs = 0, islands = 0;  ///< mean per step
  int most_pairs = 0, largest_island = 0;  ///< of all steps
  std::int64_t unconverged_islands = 0;    ///< of all steps
  std::uint64_t state_hash = 0;            ///< after one round

  double steps_per_second() const;  ///< of all bodies together, mean
  double real_time_factor() const;  ///< simulated time over mean wall time, all bodies stepped
};

/// Measures a scene of several bodies without any output, warmed up. Throws WorkError where a state becomes non-finite.
WorldBenchResult bench(const LoadedWorld& loaded, const WorldConfig& config, const BenchOptions& options);

/// What `exmat-runtime bench --json` prints of it. docs/performance.md.
nlohmann::ordered_json to_json(const WorldBenchResult& result);

}  // namespace exmat::runtime
