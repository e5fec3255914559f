#include "common/config/motion_reader.h"

#include <array>
#include <cmath>
#include <fmt/format.h>

#include "common/core/error.h"

namespace exmat {
namespace {

constexpr double kUnitTolerance = 1e-3;
constexpr double kHalfTurnCosine = 1e-6;  // of half the angle

std::string show(const Eigen::Quaterniond& q) {
  return fmt::format("[{:g}, {:g}, {:g}, {:g}]", q.w(), q.x(), q.y(), q.z());
}

void check_succession(const KeyframeConfig& before, const KeyframeConfig& key, const std::filesystem::path& file,
                      const std::string& place) {
  if (key.time <= before.time)
    throw InputError({file.string(), place + "/time", fmt::format("a number > {:g} (the key before)", before.time),
                      fmt::format("{:g}", key.time), ""});
  if (std::abs(before.orientation.dot(key.orientation)) < kHalfTurnCosine)
    throw InputError({file.string(), place + "/orientation", "less than half a turn from the key before",
                      show(key.orientation), "put a key between the two, which says which way to turn"});
}

}  // namespace

Eigen::Vector3d read_vector(const Json& json) { return Eigen::Vector3d(json.get<std::array<double, 3>>().data()); }

Eigen::Vector3d read_vector_or_zero(const Json& object, const char* name) {
  return object.contains(name) ? read_vector(object[name]) : Eigen::Vector3d::Zero();
}

Eigen::Vector3d read_direction(const Json& json, const std::filesystem::path& file, const std::string& place) {
  const Eigen::Vector3d direction = read_vector(json).stableNormalized();
  if (!(direction.norm() > 0.5)) throw InputError({file.string(), place, "a vector other than 0", json.dump(), ""});
  return direction;
}

Eigen::Quaterniond read_orientation(const Json& object, const std::filesystem::path& file, const std::string& place,
                                    const char* name) {
  if (!object.contains(name)) return Eigen::Quaterniond::Identity();
  const auto [w, x, y, z] = object[name].get<std::array<double, 4>>();
  const Eigen::Quaterniond orientation(w, x, y, z);
  if (!(std::abs(orientation.norm() - 1) <= kUnitTolerance))
    throw InputError({file.string(), fmt::format("{}/{}", place, name), "a quaternion of length 1, w first",
                      fmt::format("length {:g}", orientation.norm()), ""});
  return orientation.normalized();
}

std::vector<KeyframeConfig> read_motion(const Json& json, const std::filesystem::path& file, const std::string& place) {
  std::vector<KeyframeConfig> keys;
  for (std::size_t i = 0; i < json.size(); ++i) {
    const std::string key_place = fmt::format("{}/{}", place, i);
    const KeyframeConfig key{json[i]["time"], read_vector_or_zero(json[i], "position"),
                             read_orientation(json[i], file, key_place)};
    if (i > 0) check_succession(keys.back(), key, file, key_place);
    keys.push_back(key);
  }
  return keys;
}

}  // namespace exmat
