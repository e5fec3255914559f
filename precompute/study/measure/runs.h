#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "common/config/scene_config.h"
#include "common/model/reduced_model.h"
#include "precompute/full_space/full_space_stepper.h"
#include "precompute/study/measure/frames.h"
#include "runtime/scene/scene_loader.h"

namespace exmat::precompute {

/// [n x 3] each, world [m], [m/s].
struct WorldFrame {
  VertexArray positions, velocities;
};

/// World frame of a bundle's body in a state of its frame; `data` with /object and /modal, `full` of a body that may
/// step in full space.
WorldFrame world_frame(const ReducedModel& data, const runtime::BodyFrame& frame, const runtime::State& state,
                       const runtime::FullModel* full = nullptr);

/// Results of a reduced run.
struct ReducedRun {
  BodyFrames frames;
  std::size_t modes = 0, elements = 0;  ///< r, s
  std::string internal_force, target;   ///< as the run took them: "polynomial", "cubature"; "table", "solve", "none"
};

/// Source of a loaded scene's targets: table, solve or none.
std::string target_of(const runtime::LoadedScene& loaded);

/// Steps a scene that writes positions up to the last of `times`, each a multiple of its time step. Throws WorkError
/// at a number that is not finite.
ReducedRun run_reduced(const SceneConfig& config, const std::vector<double>& times);

/// Throws InputError at a setting with keys, which no study takes.
void require_no_keys(const SceneConfig& config);

/// The same in full space, of the body of a whole bundle, from the deformation that the reduced scene begins at.
/// `coordinates`, as FullSpaceOptions has them, hold all targets; none: all poses that descriptors stand for. Both
/// throw InputError at a setting with keys.
BodyFrames run_full_space(const SceneConfig& config, const ReducedModel& data, const std::vector<double>& times,
                          const std::vector<PoseCoordinates>& coordinates = {});

/// A body in full space, ready to step; settings with keys change as the run time's do.
struct FullSpaceRun {
  /// The body that run_full_space() steps, which also takes settings with keys.
  FullSpaceRun(const SceneConfig& config, const ReducedModel& data,
               const std::vector<PoseCoordinates>& coordinates = {});

  FullSpaceReport step();
  /// Throws WorkError at a number that is not finite.
  FullSpaceReport sound_step();

  FullSpaceModel model;
  FullSpaceScene scene;  ///< in the last step; before the first at time 0
  runtime::SceneKeys keys;
  FullSpaceState state;
  FullSpaceStepper stepper;
};

}  // namespace exmat::precompute
