#pragma once

#include <filesystem>

#include "common/config/asset_config.h"

namespace exmat {

/// The asset of an ASSET.json, or the one that a surface alone stands for. Throws InputError, also where an asset that
/// is no assumed one is to be written to `write_to`.
AssetConfig asset_from(const std::filesystem::path& asset_or_surface, const std::filesystem::path& write_to = {});

/// Writes the asset that a surface alone stands for.
void write_assumed_asset(const std::filesystem::path& surface, const std::filesystem::path& write_to);

}  // namespace exmat
