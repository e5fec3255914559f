#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "common/config/json_values.h"
#include "common/config/scene_config.h"

namespace exmat {

Eigen::Vector3d read_vector(const Json& json);

/// The vector, or zero where the member is absent.
Eigen::Vector3d read_vector_or_zero(const Json& object, const char* name);

/// A unit vector of any vector but zero.
Eigen::Vector3d read_direction(const Json& json, const std::filesystem::path& file, const std::string& place);

/// w, x, y, z of the member "orientation" of `object`, or of another name, identity where absent. Throws InputError
/// unless of length 1 within 1e-3.
Eigen::Quaterniond read_orientation(const Json& object, const std::filesystem::path& file, const std::string& place,
                                    const char* name = "orientation");

/// Times ascend strictly and orientations turn by less than half a turn from key to key, else InputError.
std::vector<KeyframeConfig> read_motion(const Json& json, const std::filesystem::path& file, const std::string& place);

}  // namespace exmat
