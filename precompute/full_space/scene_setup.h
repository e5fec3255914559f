#pragma once

#include <Eigen/Core>
#include <vector>

#include "common/config/scene_config.h"
#include "precompute/full_space/full_space_stepper.h"

namespace exmat::precompute {

/// The scene of a file in full space; `obstacles` are the file's. Newton's tolerance is the reference's own, targets
/// are solved to the end in every step. Settings with keys have the values of the config, for the caller to change
/// (runtime::SceneKeys). Throws InputError: a body that a motion carries or an attachment holds, reach, drivers,
/// compensated targets, a vertex out of range, weights that are not one for each example, obstacles or examples that
/// the model was built without.
FullSpaceScene full_space_scene(const SceneConfig& config, runtime::Obstacles obstacles, const FullSpaceModel& model);

/// The targets that the scene needs, those of the reduced model.
FullSpaceOptions full_space_options(const SceneConfig& config);

/// Start of the scene, at the deformation u [3n], such as U q. Throws InputError where the scene moves a clamped body.
FullSpaceState full_space_start(const SceneConfig& config, const FullSpaceModel& model,
                                const Eigen::VectorXd& deformation);

}  // namespace exmat::precompute
