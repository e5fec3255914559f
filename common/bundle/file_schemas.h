#pragma once

#include <string_view>

#include "common/hdf5/schema.h"

namespace exmat {

/// schemas/bundle.json and schemas/trajectory.json.
const FileSchema& bundle_schema();
const FileSchema& trajectory_schema();

// Placeholders in their paths for the name of an example, a region or a body; see fill_name().
inline constexpr std::string_view kExamplePlaceholder = "{example}";
inline constexpr std::string_view kRegionPlaceholder = "{region}";
inline constexpr std::string_view kBodyPlaceholder = "{body}";

}  // namespace exmat
