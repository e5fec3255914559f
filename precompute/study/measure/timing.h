#pragma once

#include <array>
#include <cstdint>
#include <string_view>
#include <vector>

#include "common/config/scene_config.h"
#include "runtime/sim/solver/profile.h"

namespace exmat::precompute {

/// Rounds and steps that are timed.
struct TimingConfig {
  int rounds = 5;             ///< over all points; > 0
  std::int64_t steps = 2000;  ///< most of a point in a round, which ends after a quarter of a second; > 0
};

/// Stages of a step without output.
inline constexpr std::array<std::string_view, 5> kTimedStages{"weights", "target", "internal_force", "solve",
                                                              "contact"};

/// Times of one step on one thread [s].
struct StepTimes {
  double median = 0, p95 = 0;
  double interpolation = 0;                          ///< weights and target, median: t_interp of the paper's Table 2
  std::array<double, kTimedStages.size()> stages{};  ///< medians
  std::int64_t steps = 0;                            ///< that were measured
};

/// Times the steps of each scene, in turns, so that drift of the machine falls on all alike. Whole steps are measured
/// without clocks inside, stages in turns of their own.
std::vector<StepTimes> time_steps(const std::vector<SceneConfig>& scenes, const TimingConfig& config);

}  // namespace exmat::precompute
