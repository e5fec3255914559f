#include "common/config/obstacle_reader.h"

#include <algorithm>
#include <array>
#include <fmt/format.h>
#include <fmt/ranges.h>

#include "common/config/motion_reader.h"
#include "common/core/error.h"

namespace exmat {
namespace {

constexpr std::array<const char*, 4> kShapes{"plane", "sphere", "box", "capsule"};

const char* shape_name(const Json& json, const std::filesystem::path& file, const std::string& place) {
  std::vector<const char*> named;
  std::ranges::copy_if(kShapes, std::back_inserter(named), [&](const char* name) { return json.contains(name); });
  if (named.size() != 1)
    throw InputError({file.string(), place, R"(exactly one of "plane", "sphere", "box" and "capsule")",
                      named.empty() ? "none" : fmt::format("\"{}\"", fmt::join(named, "\" and \"")), ""});
  return named.front();
}

PlaneConfig read_plane(const Json& json, const std::filesystem::path& file, const std::string& place) {
  return {read_vector_or_zero(json, "point"), read_direction(json["normal"], file, place + "/normal")};
}

SphereConfig read_sphere(const Json& json) { return {read_vector_or_zero(json, "center"), json["radius"]}; }

BoxConfig read_box(const Json& json, const std::filesystem::path& file, const std::string& place) {
  return {read_vector_or_zero(json, "center"), read_vector(json["half_extents"]), read_orientation(json, file, place)};
}

CapsuleConfig read_capsule(const Json& json) {
  return {read_vector(json["start"]), read_vector(json["end"]), json["radius"]};
}

}  // namespace

ObstacleConfig read_obstacle(const Json& json, const std::filesystem::path& file, const std::string& place) {
  const std::string name = shape_name(json, file, place);
  const std::string shape_place = place + "/" + name;
  const Json& shape = json[name];
  ObstacleConfig obstacle;
  if (name == "plane")
    obstacle.shape = read_plane(shape, file, shape_place);
  else if (name == "sphere")
    obstacle.shape = read_sphere(shape);
  else if (name == "box")
    obstacle.shape = read_box(shape, file, shape_place);
  else
    obstacle.shape = read_capsule(shape);
  obstacle.stiffness = json.value("stiffness", obstacle.stiffness);
  obstacle.damping = json.value("damping", obstacle.damping);
  obstacle.friction = json.value("friction", obstacle.friction);
  obstacle.motion = read_motion(member_or(json, "motion", Json::array()), file, place + "/motion");
  return obstacle;
}

}  // namespace exmat
