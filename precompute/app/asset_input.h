#pragma once

#include <filesystem>

#include "common/config/asset_config.h"

namespace exmat {

/// The asset of an ASSET.json, or the one that a surface alone stands for, which is then written to `write_to`, if that
/// is not empty. Throws InputError.
AssetConfig asset_from(const std::filesystem::path& asset_or_surface, const std::filesystem::path& write_to = {});

}  // namespace exmat
