#pragma once

#include <string>

#include "common/config/json_values.h"

namespace exmat::precompute {

/// The content of the SCENE.json to begin with, for an asset as assumed_asset() makes one: each example in turn takes
/// all of the weight for a second, with a second at rest between them, under gravity (y is up); targets are compensated
/// where a table can hold them; a free body falls onto a floor at `lowest` [m]. `name`: of bundle and trajectory.
Json assumed_scene(const Json& asset, const std::string& name, double lowest);

}  // namespace exmat::precompute
