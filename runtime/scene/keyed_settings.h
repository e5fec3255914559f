#pragma once

#include <string>
#include <vector>

#include "common/config/scene_config.h"
#include "runtime/sim/step/scene_keys.h"

namespace exmat::runtime {

/// A setting with these keys; an empty one of none.
KeyedSetting make_setting(const KeysConfig& config);

/// The keys of a scene. Throws InputError where weights, given or keyed, are not one for each example of the model.
SceneKeys make_keys(const SceneConfig& config, const Model& model);

/// A line of the plan for each setting that has keys.
std::vector<std::string> describe_keys(const SceneKeys& keys, const Model& model);

}  // namespace exmat::runtime
