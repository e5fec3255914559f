#pragma once

#include <filesystem>

#include "common/config/asset_config.h"
#include "common/config/scene_config.h"

namespace exmat {

/// The asset of an ASSET.json, or the one that a surface alone stands for. Throws InputError, also where an asset that
/// is no assumed one is to be written to `write_to`. For a scene that a clamp cannot follow examples in, that of an
/// assumed asset stands still. The log names what is assumed.
AssetConfig asset_from(const std::filesystem::path& asset_or_surface, const std::filesystem::path& write_to = {},
                       const SceneConfig* scene = nullptr);

/// Writes the asset that a surface alone stands for.
void write_assumed_asset(const std::filesystem::path& surface, const std::filesystem::path& write_to,
                         const SceneConfig* scene);

}  // namespace exmat
