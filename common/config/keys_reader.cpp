#include "common/config/keys_reader.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

#include "common/core/error.h"

namespace exmat {
namespace {

constexpr double kSumTolerance = 1e-9;

Eigen::VectorXd read_value(const Json& json) {
  if (json.is_number()) return Eigen::VectorXd::Constant(1, json.get<double>());
  const auto numbers = json.get<std::vector<double>>();
  return Eigen::Map<const Eigen::VectorXd>(numbers.data(), static_cast<Eigen::Index>(numbers.size()));
}

void check_sum(const Eigen::VectorXd& weights, const std::filesystem::path& file, const std::string& place) {
  if (std::abs(weights.sum() - 1) <= kSumTolerance) return;
  throw InputError({file.string(), place, "weights whose sum is 1", fmt::format("a sum of {:g}", weights.sum()), ""});
}

void read_weights(const Json& json, const std::filesystem::path& file, const std::string& place,
                  ExampleForceConfig& config) {
  if (!json.contains("weights")) return;
  if (json.contains("bias"))
    throw InputError({file.string(), place, "weights or bias", "both", "given weights are taken as they are"});
  const std::string own = place + "/weights";
  config.keys.weights = read_keys(json["weights"], file, own);
  const KeysConfig& keys = config.keys.weights;
  config.weights = keys.empty() ? read_value(json["weights"]) : keys.values.front();
  if (keys.empty()) check_sum(*config.weights, file, own);
  for (std::size_t i = 0; i < keys.values.size(); ++i)
    check_sum(keys.values[i], file, fmt::format("{}/keys/{}/value", own, i));
}

}  // namespace

KeysConfig read_keys(const Json& setting, const std::filesystem::path& file, const std::string& place) {
  KeysConfig config;
  if (!setting.is_object()) return config;
  config.interpolation = choice_or(setting, "interpolation", config.interpolation);
  const Json& keys = setting["keys"];
  for (std::size_t i = 0; i < keys.size(); ++i) {
    const double time = keys[i]["time"];
    if (i > 0 && !(time > config.times.back()))
      throw InputError({file.string(), fmt::format("{}/keys/{}/time", place, i),
                        fmt::format("a number > {:g} (the key before)", config.times.back()), fmt::format("{:g}", time),
                        ""});
    Eigen::VectorXd value = read_value(keys[i]["value"]);
    if (i > 0 && value.size() != config.values.front().size())
      throw InputError({file.string(), fmt::format("{}/keys/{}/value", place, i),
                        fmt::format("{} numbers, as in the first key", config.values.front().size()),
                        fmt::format("{}", value.size()), ""});
    config.times.push_back(time);
    config.values.push_back(std::move(value));
  }
  return config;
}

Eigen::VectorXd read_strongest(const Json& setting, const KeysConfig& keys) {
  if (keys.empty()) return read_value(setting);
  return *std::ranges::max_element(keys.values, {}, [](const Eigen::VectorXd& value) { return value.norm(); });
}

void read_example_settings(const Json& json, const std::filesystem::path& file, const std::string& place,
                           ExampleForceConfig& config) {
  const auto read = [&](const char* name, KeysConfig& keys, double& value) {
    if (!json.contains(name)) return;
    keys = read_keys(json[name], file, fmt::format("{}/{}", place, name));
    value = read_strongest(json[name], keys)[0];
  };
  read("stiffness", config.keys.stiffness, config.stiffness);
  read("damping", config.keys.damping, config.damping);
  read("bias", config.keys.bias, config.bias);
  for (const Eigen::VectorXd& bias : config.keys.bias.values) config.bias = std::min(config.bias, bias[0]);
  read_weights(json, file, place, config);
}

std::string place_of_keys(const SceneConfig& scene) {
  if (!scene.gravity_keys.empty()) return "/gravity";
  if (scene.examples && !scene.examples->keys.empty()) return scene.place + "/examples";
  for (std::size_t i = 0; i < scene.regions.size(); ++i)
    if (!scene.regions[i].force.keys.empty()) return fmt::format("{}/regions/{}", scene.place, i);
  return {};
}

}  // namespace exmat
