#pragma once

#include <optional>
#include <string>

#include "common/config/asset_config.h"
#include "common/model/needs.h"
#include "precompute/inputs/inputs.h"

namespace exmat::precompute {

/// Needs that the bundle is to serve: those of the scene if there is one, else of the asset's `needs`, else all that
/// applies.
Needs resolve_needs(const AssetConfig& asset, const std::optional<Needs>& scene_needs);

/// Needs of a scene from a region; nothing where it does not name it.
std::optional<RegionNeeds> needs_of_region(const Needs& needs, const std::string& name);

/// Every region that the needs name is one of the asset's: throws InputError where it is not.
void require_regions(const AssetConfig& asset, const Needs& needs);

/// Leaves out the groups that are not needed, and the poses of no other.
void keep_needed(const Needs& needs, bool whole_body, ExampleInput& input);

/// Part of the hash of the inputs.
std::string text_of(const Needs& needs);

}  // namespace exmat::precompute
