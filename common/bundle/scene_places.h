#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "common/config/scene_config.h"
#include "common/model/reduced_model.h"

namespace exmat {

/// The forces of a scene with their vertices, which the bundle is read for where they are named by place. Throws
/// InputError: a vertex that the object does not have, a part that is not known, a place without vertices.
std::vector<VertexForceConfig> forces_on_vertices(const SceneConfig& config);

/// Vertices of the object of the scene's bundle, read with its places, that a selection at `place` of the scene has.
/// Throws likewise.
std::vector<std::int32_t> select_vertices(const SceneConfig& config, const ObjectData& object,
                                          const VertexSelection& selection, const std::string& place);

}  // namespace exmat
