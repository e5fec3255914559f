#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "runtime/scene/bodies.h"
#include "runtime/scene/samples.h"
#include "runtime/scene/scene_loader.h"

namespace exmat::runtime {

/// What a run did.
struct RunSummary {
  std::int64_t steps = 0;  ///< of each body
  int bodies = 1;
  int threads = 1;  ///< that shared the bodies
  double simulated_seconds = 0;
  Samples step_seconds;                        ///< wall clock of a step of all bodies over their number, without output
  Samples newton_iterations;                   ///< mean of the bodies
  Samples target_iterations;                   ///< likewise
  std::int64_t projections = 0;                ///< of all bodies
  std::int64_t unconverged_steps = 0;          ///< residual above the tolerance; of all bodies
  Energies energies;                           ///< of the first body, at the end
  std::uint64_t state_hash = 0;                ///< of all bodies, at the end; see Bodies::hash
  std::optional<double> largest_displacement;  ///< over the written frames [m]; only with a trajectory
  /// Per step of a body, as the threads' clocks add up; output per frame. Only if asked for.
  std::optional<std::array<Samples, kStageNames.size()>> stage_seconds;
};

/// Steps the bodies of a loaded scene from rest and writes the trajectory of the first, if it names one. Throws
/// WorkError where a state becomes non-finite (see require_finite; no trajectory is left) or the trajectory cannot be
/// written.
RunSummary run(const LoadedScene& loaded, const SceneConfig& config, bool profiled);

/// The scene's bodies as they start; refers to `loaded`.
Bodies make_bodies(const LoadedScene& loaded, const SceneConfig& config);

/// WorkError where the last step was not finite: names step, time, body and what to try.
void require_finite(const Bodies& bodies, const SceneConfig& config);

}  // namespace exmat::runtime
