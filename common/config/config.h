#pragma once

#include <filesystem>

#include "common/config/asset_config.h"
#include "common/config/json_values.h"
#include "common/config/scene_config.h"
#include "common/config/scene_needs.h"

namespace exmat {

/// Reads ASSET.json or SCENE.json, validates it against schemas/, fills in the defaults. Throws InputError with the
/// file, the JSON pointer, what was expected and found; an unknown member suggests the nearest name.
AssetConfig load_asset(const std::filesystem::path& file);
SceneConfig load_scene(const std::filesystem::path& file);

/// The same of a scene of any number of bodies. load_scene() refuses those that list them.
WorldConfig load_world(const std::filesystem::path& file);

/// Reads the content of an ASSET.json; `file` is for messages, and paths are relative to it. Throws as load_asset.
AssetConfig asset_of(const Json& json, const std::filesystem::path& file);

/// Likewise of the content of a SCENE.json of one body. Throws as load_scene.
SceneConfig scene_of(const Json& json, const std::filesystem::path& file);
/// Likewise, as load_world().
WorldConfig world_of(const Json& json, const std::filesystem::path& file);

}  // namespace exmat
