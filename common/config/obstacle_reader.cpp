#include "common/config/obstacle_reader.h"

#include <algorithm>
#include <array>
#include <fmt/format.h>
#include <fmt/ranges.h>

#include "common/config/motion_reader.h"
#include "common/core/error.h"

namespace exmat {
namespace {

constexpr std::array<const char*, 6> kShapes{"plane", "sphere", "box", "capsule", "mesh", "height_field"};

const char* shape_name(const Json& json, const std::filesystem::path& file, const std::string& place) {
  std::vector<const char*> named;
  std::ranges::copy_if(kShapes, std::back_inserter(named), [&](const char* name) { return json.contains(name); });
  if (named.size() != 1)
    throw InputError({file.string(), place,
                      R"(exactly one of "plane", "sphere", "box", "capsule", "mesh" and "height_field")",
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

MeshConfig read_mesh(const Json& json, const std::filesystem::path& file, const std::string& place) {
  MeshConfig mesh;
  mesh.file = resolve_path(file, json["file"]);
  mesh.scale = json.value("scale", mesh.scale);
  mesh.thickness = json.value("thickness", mesh.thickness);
  mesh.position = read_vector_or_zero(json, "position");
  mesh.orientation = read_orientation(json, file, place);
  return mesh;
}

Eigen::MatrixXd read_rows(const Json& json, const std::filesystem::path& file, const std::string& place) {
  const std::size_t columns = json[0].size();
  Eigen::MatrixXd rows(std::ssize(json), static_cast<Eigen::Index>(columns));
  for (std::size_t y = 0; y < json.size(); ++y) {
    if (json[y].size() != columns)
      throw InputError({file.string(), fmt::format("{}/{}", place, y),
                        fmt::format("{} heights, as in the first row", columns), std::to_string(json[y].size()), ""});
    for (std::size_t x = 0; x < columns; ++x)
      rows(static_cast<Eigen::Index>(y), static_cast<Eigen::Index>(x)) = json[y][x];
  }
  return rows;
}

HeightFieldConfig read_height_field(const Json& json, const std::filesystem::path& file, const std::string& place) {
  if (json.contains("file") == json.contains("heights"))
    throw InputError({file.string(), place, "file or heights", json.contains("file") ? "both" : "neither", ""});
  HeightFieldConfig field;
  if (json.contains("file"))
    field.file = resolve_path(file, json["file"]);
  else
    field.heights = read_rows(json["heights"], file, place + "/heights");
  field.spacing = Eigen::Vector2d(json["spacing"][0], json["spacing"][1]);
  field.position = read_vector_or_zero(json, "position");
  field.orientation = read_orientation(json, file, place);
  return field;
}

}  // namespace

MeetingGroup read_meeting(const Json& json) {
  const MeetingGroup all;
  return {json.value("group", all.group), json.value("mask", all.mask)};
}

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
  else if (name == "capsule")
    obstacle.shape = read_capsule(shape);
  else if (name == "mesh")
    obstacle.shape = read_mesh(shape, file, shape_place);
  else
    obstacle.shape = read_height_field(shape, file, shape_place);
  obstacle.stiffness = json.value("stiffness", obstacle.stiffness);
  obstacle.damping = json.value("damping", obstacle.damping);
  obstacle.friction = json.value("friction", obstacle.friction);
  obstacle.motion = read_motion(member_or(json, "motion", Json::array()), file, place + "/motion");
  obstacle.meeting = read_meeting(json);
  return obstacle;
}

}  // namespace exmat
