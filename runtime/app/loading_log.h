#pragma once

#include "runtime/scene/scene_loader.h"
#include "runtime/scene/world_loader.h"

namespace exmat::runtime {

/// What was read, what was left out and the plan of the step, as messages.
void log_loaded(const LoadedScene& loaded, const SceneConfig& config);

/// A message for each kind of body.
void log_loaded(const LoadedWorld& loaded, const WorldConfig& config);

}  // namespace exmat::runtime
