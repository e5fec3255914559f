#include "runtime/scene/keyed_settings.h"

#include <fmt/format.h>
#include <utility>

namespace exmat::runtime {

KeyedSetting make_setting(const KeysConfig& config) {
  if (config.empty()) return {};
  RowMatrix values(std::ssize(config.values), config.values.front().size());
  for (std::size_t i = 0; i < config.values.size(); ++i)
    values.row(static_cast<Eigen::Index>(i)) = config.values[i].transpose();
  return {config.times, std::move(values), config.interpolation};
}

namespace {

ExampleKeys make_example_keys(const ExampleKeysConfig& config) {
  return {make_setting(config.stiffness), make_setting(config.damping), make_setting(config.bias),
          make_setting(config.weights)};
}

void describe(const std::string& owner, const char* name, const KeyedSetting& setting, std::vector<std::string>& plan) {
  if (setting.empty()) return;
  plan.push_back(fmt::format("{}{}: keyed, {} keys from {:g} to {:g} s, {}", owner, name, setting.times().size(),
                             setting.times().front(), setting.times().back(), name_of(setting.interpolation())));
}

}  // namespace

SceneKeys make_keys(const SceneConfig& config) {
  SceneKeys keys;
  keys.gravity = make_setting(config.gravity_keys);
  if (config.examples) keys.examples.push_back(make_example_keys(config.examples->keys));
  for (const RegionForceConfig& region : config.regions) keys.examples.push_back(make_example_keys(region.force.keys));
  return keys;
}

std::vector<std::string> describe_keys(const SceneKeys& keys, const Model& model) {
  std::vector<std::string> plan;
  describe("", "gravity", keys.gravity, plan);
  for (std::size_t i = 0; i < keys.examples.size(); ++i) {
    const std::string& region = model.examples[i].region;
    const std::string owner = region.empty() ? "examples: " : fmt::format("region {}: ", region);
    describe(owner, "stiffness", keys.examples[i].stiffness, plan);
    describe(owner, "damping", keys.examples[i].damping, plan);
    describe(owner, "bias", keys.examples[i].bias, plan);
    describe(owner, "given weights", keys.examples[i].weights, plan);
  }
  return plan;
}

}  // namespace exmat::runtime
