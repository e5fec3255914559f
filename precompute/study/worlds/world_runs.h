#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "common/config/scene_config.h"
#include "precompute/study/measure/frames.h"
#include "precompute/study/measure/timing.h"

namespace exmat::precompute {

/// Results of a run of a scene of several bodies.
struct WorldRun {
  std::vector<std::string> names;            ///< one for each body
  std::vector<std::size_t> kinds;            ///< place of each body's kind among the scene's "bodies"
  std::vector<BodyFrames> bodies;            ///< counts are the same in all: steps of all bodies
  std::vector<std::size_t> modes, elements;  ///< r and s of each kind; none in full space
};

/// Steps the bodies up to the last of `times`, each a multiple of the time step. Throws WorkError at a number that is
/// not finite.
WorldRun run_world(const WorldConfig& config, const std::vector<double>& times);

/// The same with all bodies in full space, solved to 1e-8 of the forces; their bundles have /full_space.
WorldRun run_full_space_world(WorldConfig config, const std::vector<double>& times);

/// Times of steps of all bodies over their number [s], by one thread, of each scene in turns.
std::vector<StepTimes> time_worlds(const std::vector<WorldConfig>& scenes, const TimingConfig& config);

/// All bodies of a run as one: positions and velocities below each other, energies added up.
BodyFrames all_of(const WorldRun& run);

}  // namespace exmat::precompute
