#include "common/config/scene_config.h"

#include <algorithm>
#include <fmt/format.h>

#include "common/config/config.h"
#include "common/config/json_file.h"
#include "common/config/json_values.h"
#include "common/config/motion_reader.h"
#include "common/config/obstacle_reader.h"
#include "common/config/vertex_ids.h"
#include "common/core/error.h"

namespace exmat {
namespace {

ExampleForceConfig read_example_force(const Json& json) {
  ExampleForceConfig config;
  config.law = choice_or(json, "force", config.law);
  config.stiffness = json["stiffness"];
  config.damping = json.value("damping", config.damping);
  config.bias = json.value("bias", config.bias);
  config.target = choice_or(json, "target", config.target);
  config.target_iterations = json.value("target_iterations", config.target_iterations);
  config.energy_reference = choice_or(json, "energy_reference", config.energy_reference);
  return config;
}

std::vector<RegionForceConfig> read_region_forces(const Json& json, const std::filesystem::path& file) {
  std::vector<RegionForceConfig> regions;
  for (std::size_t i = 0; i < json.size(); ++i) {
    RegionForceConfig region{json[i]["name"], read_example_force(json[i])};
    if (std::ranges::find(regions, region.name, &RegionForceConfig::name) != regions.end())
      throw InputError({file.string(), fmt::format("/regions/{}/name", i), "each region once",
                        fmt::format("\"{}\" again", region.name), ""});
    regions.push_back(std::move(region));
  }
  return regions;
}

VertexForceConfig read_vertex_force(const Json& json, const std::filesystem::path& file, const std::string& place) {
  VertexForceConfig config;
  const Json& vertices = json["vertices"];
  config.vertices = vertices.contains("file") ? read_vertex_ids(resolve_path(file, vertices["file"]))
                                              : read_ids(vertices["ids"], file, place + "/vertices/ids");
  config.force = read_vector(json["force"]);
  config.start = json.value("start", config.start);
  config.end = json.value("end", config.end);
  if (config.end <= config.start)
    throw InputError({file.string(), place + "/end", fmt::format("a number > {} (start)", config.start),
                      fmt::format("{}", config.end), ""});
  return config;
}

std::optional<Eigen::Vector3d> optional_vector(const Json& json, const char* name) {
  return json.contains(name) ? std::optional(read_vector(json[name])) : std::nullopt;
}

Eigen::VectorXd read_numbers(const Json& json) {
  const auto numbers = json.get<std::vector<double>>();
  return Eigen::Map<const Eigen::VectorXd>(numbers.data(), static_cast<Eigen::Index>(numbers.size()));
}

BodyConfig read_body(const Json& json, const std::filesystem::path& file, const std::string& place) {
  if (json.contains("reduced") && json.contains("pose"))
    throw InputError({file.string(), place, "reduced or pose", "both", ""});
  BodyConfig body;
  body.position = optional_vector(json, "position");
  if (json.contains("orientation")) body.orientation = read_orientation(json, file, place);
  body.linear_velocity = optional_vector(json, "linear_velocity");
  body.angular_velocity = optional_vector(json, "angular_velocity");
  if (json.contains("reduced")) body.reduced = read_numbers(json["reduced"]);
  if (json.contains("pose")) body.pose = PoseConfig{json["pose"]["example"], json["pose"].value("weight", 1.0)};
  body.motion = read_motion(member_or(json, "motion", Json::array()), file, place + "/motion");
  return body;
}

}  // namespace

SceneConfig load_scene(const std::filesystem::path& file) {
  const Json json = read_json(file);
  check_against_schema(json, "scene", file);
  SceneConfig scene;
  scene.file = file;
  scene.bundle = resolve_path(file, json["bundle"]);
  scene.time_step = json.value("time_step", scene.time_step);
  scene.steps = json.value("steps", scene.steps);
  if (json.contains("gravity")) scene.gravity = read_vector(json["gravity"]);
  scene.integrator = choice_or(json, "integrator", scene.integrator);
  scene.internal_force = choice_or(json, "internal_force", scene.internal_force);
  const Json damping = member_or(json, "damping", Json::object());
  scene.mass_damping = damping.value("mass", scene.mass_damping);
  scene.stiffness_damping = damping.value("stiffness", scene.stiffness_damping);
  const Json newton = member_or(json, "newton", Json::object());
  scene.newton.max_iterations = newton.value("max_iterations", scene.newton.max_iterations);
  scene.newton.tolerance = newton.value("tolerance", scene.newton.tolerance);
  if (json.contains("examples")) scene.examples = read_example_force(json["examples"]);
  scene.regions = read_region_forces(member_or(json, "regions", Json::array()), file);
  const Json forces = member_or(json, "forces", Json::array());
  for (std::size_t i = 0; i < forces.size(); ++i)
    scene.forces.push_back(read_vertex_force(forces[i], file, fmt::format("/forces/{}", i)));
  scene.body = read_body(member_or(json, "body", Json::object()), file, "/body");
  const Json obstacles = member_or(json, "obstacles", Json::array());
  for (std::size_t i = 0; i < obstacles.size(); ++i)
    scene.obstacles.push_back(read_obstacle(obstacles[i], file, fmt::format("/obstacles/{}", i)));
  scene.instances = json.value("instances", scene.instances);
  const Json output = member_or(json, "output", Json::object());
  if (output.contains("trajectory")) scene.trajectory = resolve_path(file, output["trajectory"]);
  scene.every = output.value("every", scene.every);
  scene.render = output.value("render", scene.render);
  return scene;
}

Needs needs_of(const SceneConfig& scene) {
  Needs needs{.examples = scene.examples || scene.body.pose,
              .carried = !scene.body.motion.empty(),
              .targets = scene.examples && scene.examples->target != TargetSource::kSolve,
              .target_elasticity = scene.examples && scene.examples->law == ExampleForceLaw::kElastic,
              .contact = scene.meets_others || !scene.obstacles.empty(),
              .render = scene.render,
              .internal_force = scene.internal_force};
  if (scene.examples) needs.energy_reference = scene.examples->energy_reference;
  std::vector<RegionNeeds>& regions = needs.regions.emplace();
  for (const auto& [name, force] : scene.regions)
    regions.push_back({.name = name,
                       .targets = force.target != TargetSource::kSolve,
                       .energy_reference = force.energy_reference,
                       .target_elasticity = force.law == ExampleForceLaw::kElastic});
  return needs;
}

}  // namespace exmat
