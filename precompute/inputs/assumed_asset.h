#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "common/config/json_values.h"

namespace exmat::precompute {

/// The content of the ASSET.json that a surface alone stands for, with every member that matters written out: its morph
/// targets, the first 64 of them, are the examples, its attribute _FIXED is the clamp, and its material bears
/// kBorneHeights times its weight. Where a target moves the clamp so that 2 % of it would be lost, the clamp follows.
/// Paths in it are relative to `folder`. Throws as read_surface_file.
Json assumed_asset(const std::filesystem::path& surface, const std::filesystem::path& folder);

/// Names for examples of morph targets: without '/', control characters and names of other entries of a bundle, at most
/// 64 bytes, whole characters, each once. Safe names stay.
std::vector<std::string> example_names(const std::vector<std::string>& morphs);

/// Young's modulus of an assumed material over density x gravity x the longest edge of the bounding box: a column that
/// high sinks by a thirtieth under its own weight, as rubber a metre high does.
constexpr double kBorneHeights = 30;

}  // namespace exmat::precompute
