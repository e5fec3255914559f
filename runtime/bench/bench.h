#pragma once

#include <array>
#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <string_view>

#include "runtime/scene/samples.h"
#include "runtime/scene/scene_loader.h"
#include "runtime/scene/scene_run.h"
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

/// How long a step takes and what it computes. Times are of steps of all bodies over their number. The steps are those
/// from rest on; a round measures all of them twice, in turns of a few milliseconds: whole steps without and stages
/// with clocks inside. In between the DGEMM rate is measured.
struct BenchResult {
  Eigen::Index modes = 0, elements = 0;  ///< r, s
  std::int64_t vertices = 0, tets = 0, examples = 0;
  std::string integrator, internal_force, target, instruction_set;
  double time_step = 0;  ///< [s]
  std::int64_t steps = 0, rounds = 0;
  int instances = 1, threads = 1;
  Samples step_seconds;
  std::array<BenchStage, kBenchStageNames.size()> stages;
  double bytes = 0;                                                ///< per step of a body, see StepWork
  double dgemm_flops_per_second = 0, dgemm_median_per_second = 0;  ///< of one thread: best and median, see DgemmRate
  double newton_iterations = 0, factorisations = 0;                ///< mean per step of a body, as the next three
  double line_search_evaluations = 0, projections = 0, target_iterations = 0;
  std::uint64_t state_hash = 0;  ///< after one round

  double flops() const;             ///< per step of a body: sum of the stages
  double flops_per_second() const;  ///< of the median step
  double limit_seconds() const;     ///< flops() at the DGEMM rate
  double limit_ratio() const;       ///< median step over limit_seconds(); at best 1 / threads
  double steps_per_second() const;  ///< of all bodies together, mean
  double real_time_factor() const;  ///< simulated time over mean wall time, all bodies stepped
};

/// Measures a scene without any output, warmed up. Throws WorkError where a state becomes non-finite.
BenchResult bench(const LoadedScene& loaded, const SceneConfig& config, const BenchOptions& options);

/// What `exmat-runtime bench --json` prints. docs/performance.md.
nlohmann::ordered_json to_json(const BenchResult& result);

}  // namespace exmat::runtime
