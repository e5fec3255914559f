#include "runtime/scene/obstacle_loader.h"

#include <algorithm>
#include <fmt/format.h>
#include <memory>
#include <utility>
#include <vector>

#include "common/core/error.h"
#include "common/core/log.h"
#include "common/mesh/surface_check.h"
#include "common/surface_io/height_reader.h"
#include "common/surface_io/plain_surface.h"

namespace exmat::runtime {
namespace {

Shape make_shape(const PlaneConfig& plane) { return Plane{plane.point, plane.normal}; }
Shape make_shape(const SphereConfig& sphere) { return Sphere{sphere.centre, sphere.radius}; }
Shape make_shape(const BoxConfig& box) { return Box{box.centre, box.half_extents, box.orientation.toRotationMatrix()}; }
Shape make_shape(const CapsuleConfig& capsule) { return Capsule{capsule.start, capsule.end, capsule.radius}; }

Shape make_shape(const MeshConfig& mesh) {
  SurfaceFile read = read_plain_surface(mesh.file);
  const std::string file = mesh.file.string();
  for (const std::string& warning : read.warnings) log::warning(fmt::format("{}: {}", file, warning));
  SurfaceMesh& surface = read.mesh;
  weld(surface.vertices, surface.triangles);
  if (surface.triangles.rows() == 0)
    throw InputError({file, "", "triangles with corners at three places", "none", "check the file and its scale"});
  if (mesh.thickness == 0) {
    if (const SurfaceFaults faults = surface_faults(surface.triangles); faults.any())
      throw InputError({file, "", "a closed mesh, each edge of two triangles that look the same way out",
                        faults.words(), "close it and turn its faces outward, or give the obstacle a \"thickness\""});
    if (enclosed_volume(surface.vertices, surface.triangles) < 0)
      log::warning(
          fmt::format("{}: its faces look inward: the obstacle is what is around it, a room; turn the faces if "
                      "it is to be a solid",
                      file));
  }
  surface.vertices *= mesh.scale;
  return MeshShape{std::make_shared<RigidMesh>(surface.vertices, surface.triangles, mesh.thickness), mesh.position,
                   mesh.orientation.toRotationMatrix()};
}

Shape make_shape(const HeightFieldConfig& field) {
  RowMatrix heights = field.file ? read_heights(*field.file) : RowMatrix(field.heights);
  return HeightFieldShape{std::make_shared<HeightField>(std::move(heights), field.spacing), field.position,
                          field.orientation.toRotationMatrix()};
}

/// The examples of the whole body first, then those of regions.
std::vector<const ExampleData*> examples_of(const ReducedModel& data) {
  std::vector<const ExampleData*> examples;
  const auto add = [&](const ExampleSet& set) {
    for (const ExampleData& example : set.examples) examples.push_back(&example);
  };
  if (data.examples) add(*data.examples);
  for (const RegionData& region : data.regions) add(region.examples);
  return examples;
}

std::string example_names(const ReducedModel& data) {
  std::string names;
  for (const ExampleData* example : examples_of(data))
    names += fmt::format("{}\"{}\"", names.empty() ? "" : ", ", example->name);
  return names.empty() ? "it has none" : "it has " + names;
}

Eigen::VectorXd example_coordinates(const SceneConfig& config, const ReducedModel& data) {
  const PoseConfig& pose = *config.body.pose;
  const auto examples = examples_of(data);
  const auto example = std::ranges::find(examples, pose.example, &ExampleData::name);
  if (example == examples.end())
    throw InputError({config.file.string(), config.place + "/body/pose/example",
                      fmt::format("an example of {}; {}", config.bundle.string(), example_names(data)),
                      '"' + pose.example + '"', ""});
  return pose.weight * (*example)->pose;
}

}  // namespace

RigidMotion make_motion(const std::vector<KeyframeConfig>& keys) {
  std::vector<Keyframe> frames;
  for (const KeyframeConfig& key : keys) frames.push_back({key.time, key.position, key.orientation});
  return RigidMotion(frames);
}

Obstacles make_obstacles(const std::vector<ObstacleConfig>& configs, double release) {
  Obstacles obstacles;
  for (const ObstacleConfig& obstacle : configs)
    obstacles.push_back(Obstacle{std::visit([](const auto& shape) { return make_shape(shape); }, obstacle.shape),
                                 make_motion(obstacle.motion), obstacle.stiffness, obstacle.damping, obstacle.friction,
                                 obstacle.meeting, release});
  return obstacles;
}

Obstacles obstacles_of(const MeetingGroup& body, const Obstacles& all) {
  Obstacles met;
  std::ranges::copy_if(all, std::back_inserter(met),
                       [&](const SharedObstacle& obstacle) { return obstacle->meeting.meets(body); });
  return met;
}

Obstacles make_obstacles(const SceneConfig& config) {
  return obstacles_of(config.meeting, make_obstacles(config.obstacles));
}

void check_body(const SceneConfig& config, bool constrained) {
  const BodyConfig& body = config.body;
  const std::pair<const char*, bool> rigid_state[] = {{"position", body.position.has_value()},
                                                      {"orientation", body.orientation.has_value()},
                                                      {"linear_velocity", body.linear_velocity.has_value()},
                                                      {"angular_velocity", body.angular_velocity.has_value()}};
  for (const auto& [name, given] : rigid_state)
    if (given && constrained)
      throw InputError({config.file.string(), fmt::format("{}/body/{}", config.place, name), "no such member",
                        "one, and the bundle's body has fixed vertices",
                        "\"motion\" says where they are; an asset without \"fixed\" makes a free body"});
  if (!body.motion.empty() && !constrained)
    throw InputError({config.file.string(), config.place + "/body/motion", "no such member",
                      "one, and the bundle's body has no fixed vertices to carry",
                      "name \"fixed\" vertices in the asset"});
}

Eigen::VectorXd start_coordinates(const SceneConfig& config, const ReducedModel& data, Eigen::Index modes) {
  const BodyConfig& body = config.body;
  if (body.pose) return example_coordinates(config, data);
  if (!body.reduced) return Eigen::VectorXd::Zero(modes);
  if (body.reduced->size() != modes)
    throw InputError({config.file.string(), config.place + "/body/reduced",
                      fmt::format("{} numbers, as many as {} has modes", modes, config.bundle.string()),
                      std::to_string(body.reduced->size()), ""});
  return *body.reduced;
}

}  // namespace exmat::runtime
