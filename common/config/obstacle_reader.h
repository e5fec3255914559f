#pragma once

#include <filesystem>
#include <string>

#include "common/config/json_values.h"
#include "common/config/scene_config.h"

namespace exmat {

/// Members `group` and `mask`.
MeetingGroup read_meeting(const Json& json);

/// Throws InputError unless it names exactly one shape.
ObstacleConfig read_obstacle(const Json& json, const std::filesystem::path& file, const std::string& place);

}  // namespace exmat
