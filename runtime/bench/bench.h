#pragma once

#include <array>
#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "runtime/scene/samples.h"
#include "runtime/scene/world_loader.h"
#include "runtime/sim/solver/profile.h"

namespace exmat::runtime {

/// The stages of a step, and what is left of it in the place of output.
inline constexpr std::size_t kOtherStage = static_cast<std::size_t>(Stage::kOutput);
inline constexpr auto kBenchStageNames = [] {
  auto names = kStageNames;
  names[kOtherStage] = "other";
  return names;
}();

struct BenchOptions {
  std::optional<std::int64_t> steps =
      std::nullopt;    ///< >= 1; absent: the scene's, or fewer if one round would take over `seconds`
  double seconds = 2;  ///< rounds of that many steps are added until the bodies stepped about so long
};

struct BenchStage {
  Samples seconds;   ///< per step of a body, as the threads' clocks add up
  double flops = 0;  ///< per step of a body
};

/// The bodies of one kind.
struct BenchKind {
  std::string name;  ///< empty: the scene names a single bundle
  std::int64_t bodies = 0, vertices = 0, tets = 0, examples = 0;
  Eigen::Index modes = 0, elements = 0;  ///< r, s
  std::string internal_force, target;
  std::int64_t contact_vertices = 0, triangles = 0;  ///< that look for contacts, that others touch
};

/// Time and computations of a step. Times are of steps of all bodies over their number. The steps are those
/// from rest on; a round measures all of them twice, in turns of a few milliseconds: whole steps without and stages
/// with clocks inside. In between the DGEMM rate is measured. Flops and bytes are those of bodies that touch no other.
struct BenchResult {
  std::vector<BenchKind> kinds;
  std::string integrator, instruction_set;
  double time_step = 0;  ///< [s]
  std::int64_t steps = 0, rounds = 0;
  int instances = 1, threads = 1;
  Samples step_seconds;
  std::array<BenchStage, kBenchStageNames.size()> stages;     ///< stages of bodies that touch no other
  bool is_world = false;                                      ///< some may touch others: then the next members count
  std::array<Samples, kWorldStageNames.size()> world_stages;  ///< on the wall clock
  double touching_pairs = 0, islands = 0;                     ///< mean per step
  int most_pairs = 0, largest_island = 0;                     ///< largest of all steps
  std::int64_t unconverged_islands = 0;                       ///< sum over all steps
  double bytes = 0;                                           ///< per step of a body, see StepWork
  double dgemm_flops_per_second = 0, dgemm_median_per_second = 0;  ///< one thread's: best and median, see DgemmRate
  double newton_iterations = 0, factorisations = 0;                ///< mean per step of a body, as the next three
  double line_search_evaluations = 0, projections = 0, target_iterations = 0;
  std::uint64_t state_hash = 0;  ///< after one round

  double flops() const;             ///< per step of a body: sum of the stages
  double flops_per_second() const;  ///< rate of the median step
  double limit_seconds() const;     ///< flops() at the DGEMM rate
  double limit_ratio() const;       ///< median step over limit_seconds(); at best 1 / threads
  double steps_per_second() const;  ///< rate of all bodies together, mean
  double real_time_factor() const;  ///< simulated time over mean wall time, all bodies stepped
};

/// Measures a scene without any output, warmed up. Throws WorkError where a state becomes non-finite.
BenchResult bench(const LoadedWorld& loaded, const WorldConfig& config, const BenchOptions& options);

/// JSON that `exmat-runtime bench --json` prints. docs/performance.md.
nlohmann::ordered_json to_json(const BenchResult& result);

}  // namespace exmat::runtime
