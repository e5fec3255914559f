#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "runtime/scene/samples.h"
#include "runtime/scene/scene_run.h"
#include "runtime/scene/world_loader.h"

namespace exmat::runtime {

/// Of the stages of the steps of several bodies, on the wall clock, over the number of bodies.
struct WorldStageSamples {
  std::array<Samples, kWorldStageNames.size()> step;
  Samples output;  ///< of each step: 0 where it wrote no frame
};

/// What presses the body of a kind at the end that is pressed most, by obstacles and by other bodies.
struct PressedBody {
  int body = -1;         ///< -1: nothing touches any
  double force = 0;      ///< sum of the forces on vertices [N]
  Eigen::VectorXd load;  ///< [3n] in the body's own frame
};

/// What a run of several bodies did.
struct WorldSummary {
  std::int64_t steps = 0;  ///< of each body
  int bodies = 0;
  int threads = 1;
  double simulated_seconds = 0;
  Samples step_seconds;       ///< wall clock of a step of all bodies over their number, without output
  Samples newton_iterations;  ///< most of an island
  Samples touching_pairs;     ///< of bodies near enough to touch
  int most_pairs = 0;
  int largest_island = 0;                          ///< bodies solved together
  std::int64_t unconverged_islands = 0;            ///< of all steps
  std::int64_t unconverged_steps = 0;              ///< residual above the tolerance; of all bodies
  Energies start, end;                             ///< of all bodies
  double deepest = 0;                              ///< that a vertex is inside another body at the end [m]
  std::uint64_t state_hash = 0;                    ///< of all bodies, at the end, as Bodies::hash
  std::optional<double> largest_displacement;      ///< over the written frames [m]; only with a trajectory
  std::vector<PressedBody> most_pressed;           ///< of each kind; only if asked for
  std::optional<WorldStageSamples> stage_seconds;  ///< only if asked for
};

/// Steps all bodies from their start or from a state file, and writes the trajectory, if the scene names one. As many
/// threads as OpenMP gives. Throws WorkError where a state becomes non-finite (no trajectory is left) or a file cannot
/// be written, InputError where the state file does not fit.
WorldSummary run(const LoadedWorld& loaded, const WorldConfig& config, const RunOptions& options = {});

}  // namespace exmat::runtime
