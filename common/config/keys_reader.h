#pragma once

#include <filesystem>
#include <string>

#include "common/config/json_values.h"
#include "common/config/scene_config.h"

namespace exmat {

/// Keys of a setting that is a value or an object of keys; none of a value. Times ascend strictly, else InputError.
KeysConfig read_keys(const Json& setting, const std::filesystem::path& file, const std::string& place);

/// The value of a setting, or of the strongest of its keys: the one of the largest norm.
Eigen::VectorXd read_strongest(const Json& setting, const KeysConfig& keys);

/// Settings of an example force that keys may change: stiffness, damping, bias and weights. Throws InputError where
/// weights do not add up to 1, or are given beside a bias.
void read_example_settings(const Json& json, const std::filesystem::path& file, const std::string& place,
                           ExampleForceConfig& config);

}  // namespace exmat
