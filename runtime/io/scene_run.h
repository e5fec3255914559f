#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "runtime/io/samples.h"
#include "runtime/io/scene_loader.h"
#include "runtime/sim/stepper.h"

namespace exmat::runtime {

/// What a run did.
struct RunSummary {
  std::int64_t steps = 0;
  double simulated_seconds = 0;
  Samples step_seconds;  ///< wall clock, without output
  Samples newton_iterations;
  Samples target_iterations;
  std::int64_t projections = 0;
  std::int64_t unconverged_steps = 0;          ///< residual above the tolerance
  Energies energies;                           ///< at the end
  std::optional<double> largest_displacement;  ///< over the written frames [m]; only with a trajectory
  std::optional<std::array<Samples, kStageNames.size()>> stage_seconds;  ///< per step; only if asked for
};

/// Steps a loaded scene from rest and writes its trajectory, if it names one. Throws WorkError where the state becomes
/// non-finite (names step, time and what to try; no trajectory is left) or the trajectory cannot be written.
RunSummary run(const LoadedScene& loaded, const SceneConfig& config, bool profiled);

}  // namespace exmat::runtime
