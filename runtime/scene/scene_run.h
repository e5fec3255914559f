#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>

#include "runtime/output/trajectory.h"
#include "runtime/scene/bodies.h"
#include "runtime/scene/samples.h"
#include "runtime/scene/scene_loader.h"

namespace exmat::runtime {

/// The contacts of a body when they pressed it most.
struct HardestContact {
  double force = 0;      ///< their sum [N]; 0: nothing touched
  double time = 0;       ///< [s]
  Eigen::VectorXd load;  ///< [3n] in the body's own frame
};

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
  std::int64_t slept_steps = 0;                ///< that bodies slept through; of all bodies
  Energies energies;                           ///< of the first body, at the end
  std::uint64_t state_hash = 0;                ///< of all bodies, at the end; see Bodies::hash
  std::optional<double> largest_displacement;  ///< over the written frames [m]; only with a trajectory
  HardestContact hardest_contact;              ///< with obstacles, of a single body; only if asked for
  /// Per step of a body, as the threads' clocks add up; output per frame. Only if asked for.
  std::optional<std::array<Samples, kStageNames.size()>> stage_seconds;
};

struct RunOptions {
  bool profiled = false;                              ///< measure each stage
  bool keeps_contacts = false;                        ///< remember the hardest, or of several bodies those of the end
  std::optional<std::filesystem::path> from_state{};  ///< a state file to begin at, instead of the scene's start
  std::optional<std::filesystem::path> dump_state{};  ///< a state file to write at the end, or before a bad step
};

/// Steps the bodies of a loaded scene from its start, as many steps as it says, and writes the trajectory of the first,
/// if it names one. Throws WorkError where a state becomes non-finite (see require_finite; no trajectory is left) or a
/// file cannot be written, InputError where the state file does not fit.
RunSummary run(const LoadedScene& loaded, const SceneConfig& config, const RunOptions& options = {});

/// What the trajectory of a scene says of its run; the scene names one.
TrajectoryInfo trajectory_info(const LoadedScene& loaded, const SceneConfig& config);

/// The scene's bodies as they start; refers to `loaded`.
Bodies make_bodies(const LoadedScene& loaded, const SceneConfig& config);

/// WorkError where the last step was not finite: names step, time, body and what to try.
void require_finite(const Bodies& bodies, const SceneConfig& config);

}  // namespace exmat::runtime
