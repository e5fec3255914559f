#pragma once

#include <string>
#include <vector>

#include "common/config/scene_config.h"
#include "runtime/sim/step/scene_keys.h"

namespace exmat::runtime {

/// A setting with these keys; an empty one of none.
KeyedSetting make_setting(const KeysConfig& config);

/// The keys of a scene, whose weights are one for each example of its model (require_weights()).
SceneKeys make_keys(const SceneConfig& config);

/// A line of the plan for each setting that has keys.
std::vector<std::string> describe_keys(const SceneKeys& keys, const Model& model);

}  // namespace exmat::runtime
