#pragma once

#include <string>

#include "common/config/json_values.h"
#include "precompute/mesh_io/surface_file.h"

namespace exmat::precompute {

/// The content of the SCENE.json to begin with, for an asset as assumed_asset() makes one: each example in turn takes
/// all of the weight for a second, with a second at rest between them, under gravity (y is up); targets are compensated
/// where a table can hold them and the surface has no bones; a free body falls onto a floor below it. `name`: of bundle
/// and trajectory.
Json assumed_scene(const Json& asset, const std::string& name, const SurfaceFile& surface);

}  // namespace exmat::precompute
