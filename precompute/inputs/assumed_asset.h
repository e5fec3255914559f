#pragma once

#include <filesystem>

#include "common/config/json_values.h"

namespace exmat::precompute {

/// Whether the extension is that of a file of surfaces.
bool is_surface_file(const std::filesystem::path& file);

/// The content of the ASSET.json that a surface alone stands for, with every member that matters written out: its morph
/// targets are the examples, its attribute _FIXED is the clamp, and its material bears kBorneHeights times its weight.
/// Paths in it are relative to `folder`. Throws as read_surface_file.
Json assumed_asset(const std::filesystem::path& surface, const std::filesystem::path& folder);

/// Young's modulus of an assumed material over density x gravity x the longest edge of the bounding box: a column that
/// high sinks by a thirtieth under its own weight, as rubber a metre high does.
constexpr double kBorneHeights = 30;

}  // namespace exmat::precompute
