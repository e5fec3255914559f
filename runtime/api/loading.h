#pragma once

#include <memory>

#include "common/config/scene_config.h"
#include "runtime/api/handles.h"
#include "runtime/api/world_handle.h"

namespace exmat::runtime {

// Throw InputError, as load_run() and load_world_run(). Call them while reading() is locked.

/// A new model of a scene of one body.
exmat_model* load_model(SceneConfig config);

/// A world with all bodies and obstacles of a scene.
std::unique_ptr<exmat_world> load_world(const WorldConfig& config);

}  // namespace exmat::runtime
