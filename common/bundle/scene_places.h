#pragma once

#include <vector>

#include "common/config/scene_config.h"

namespace exmat {

/// The forces of a scene with their vertices, which the bundle is read for where they are named by place. Throws
/// InputError: a vertex that the object does not have, a part that is not known, a place without vertices.
std::vector<VertexForceConfig> forces_on_vertices(const SceneConfig& config);

}  // namespace exmat
