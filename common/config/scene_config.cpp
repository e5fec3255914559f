#include "common/config/scene_config.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <fmt/format.h>

#include "common/config/attachment_reader.h"
#include "common/config/config.h"
#include "common/config/json_file.h"
#include "common/config/json_values.h"
#include "common/config/keys_reader.h"
#include "common/config/motion_reader.h"
#include "common/config/obstacle_reader.h"
#include "common/config/pose_file.h"
#include "common/config/selection_reader.h"
#include "common/config/vertex_ids.h"
#include "common/core/error.h"

namespace exmat {
namespace {

DriverConfig read_driver(const Json& json, const std::filesystem::path& file, const std::string& place) {
  DriverConfig driver{json["example"], json["joint"]};
  const bool by_angle = json.contains("axis") && json.contains("angles");
  const bool by_rotation = json.contains("rotation") && json.contains("radius");
  if (by_angle == by_rotation || json.size() != 4)
    throw InputError({file.string(), place, "axis and angles, or rotation and radius",
                      json.size() > 4 ? "members of both" : "other members", ""});
  if (by_rotation) {
    driver.rotation = read_orientation(json, file, place, "rotation");
    driver.radius = json["radius"];
    return driver;
  }
  driver.axis = read_direction(json["axis"], file, place + "/axis");
  driver.angles = json["angles"].get<std::array<double, 2>>();
  if (driver.angles[0] == driver.angles[1])
    throw InputError({file.string(), place + "/angles", "two angles that differ", json["angles"].dump(), ""});
  return driver;
}

void read_drivers(const Json& json, const std::filesystem::path& file, const std::string& place,
                  ExampleForceConfig& config) {
  if (!json.contains("drivers")) return;
  for (const char* name : {"weights", "bias"})
    if (json.contains(name))
      throw InputError({file.string(), place, fmt::format("{} or drivers", name), "both",
                        "weights of drivers are taken as they are"});
  for (std::size_t i = 0; i < json["drivers"].size(); ++i)
    config.drivers.push_back(read_driver(json["drivers"][i], file, fmt::format("{}/drivers/{}", place, i)));
}

ExampleForceConfig read_example_force(const Json& json, const std::filesystem::path& file, const std::string& place) {
  ExampleForceConfig config;
  read_example_settings(json, file, place, config);
  read_drivers(json, file, place, config);
  config.law = choice_or(json, "force", config.law);
  config.target = choice_or(json, "target", config.target);
  config.target_iterations = json.value("target_iterations", config.target_iterations);
  config.energy_reference = choice_or(json, "energy_reference", config.energy_reference);
  config.compensate = json.value("compensate", config.compensate);
  if (config.compensate && (config.law == ExampleForceLaw::kElastic || config.target == TargetSource::kSolve))
    throw InputError({file.string(), place + "/compensate", "a linear force with a table of targets",
                      config.law == ExampleForceLaw::kElastic ? "an elastic force" : "targets that are solved for",
                      "leave force and target out"});
  return config;
}

std::vector<RegionForceConfig> read_region_forces(const Json& json, const std::filesystem::path& file,
                                                  const std::string& place) {
  std::vector<RegionForceConfig> regions;
  for (std::size_t i = 0; i < json.size(); ++i) {
    RegionForceConfig region{json[i]["name"],
                             read_example_force(json[i], file, fmt::format("{}/regions/{}", place, i))};
    if (std::ranges::find(regions, region.name, &RegionForceConfig::name) != regions.end())
      throw InputError({file.string(), fmt::format("{}/regions/{}/name", place, i), "each region once",
                        fmt::format("\"{}\" again", region.name), ""});
    regions.push_back(std::move(region));
  }
  return regions;
}

VertexForceConfig read_vertex_force(const Json& json, const std::filesystem::path& file, const std::string& place) {
  VertexForceConfig config;
  VertexSelection places = read_selection(json["vertices"], file, place + "/vertices");
  if (const auto* from = std::get_if<FileSelection>(&places)) {
    require_file(from->file, file, place + "/vertices/file", "a text file of vertex ids");
    config.vertices = read_vertex_ids(from->file);
  } else if (auto* ids = std::get_if<IdSelection>(&places)) {
    config.vertices = std::move(ids->ids);
  } else {
    config.places = std::move(places);
  }
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
  if (json.contains("animation")) {
    const Json& animation = json["animation"];
    const AnimationConfig absent;
    body.animation = AnimationConfig{animation["name"], animation.value("speed", absent.speed),
                                     animation.value("loop", absent.loop), animation.value("start", absent.start)};
  }
  const Json bones = member_or(json, "bones", Json::array());
  for (std::size_t i = 0; i < bones.size(); ++i) {
    const std::string own = fmt::format("{}/bones/{}", place, i);
    const std::string joint = bones[i]["joint"];
    if (std::ranges::find(body.bones, joint, &JointMotionConfig::joint) != body.bones.end())
      throw InputError({file.string(), own + "/joint", "each joint once", fmt::format("\"{}\" again", joint), ""});
    body.bones.push_back({joint, read_motion(bones[i]["motion"], file, own + "/motion")});
  }
  return body;
}

ReachConfig read_reach(const Json& json, const std::filesystem::path& file, const std::string& place) {
  ReachConfig reach;
  reach.region = json.value("region", reach.region);
  for (const Json& own : json["targets"]) {
    const std::string at = fmt::format("{}/targets/{}", place, reach.targets.size());
    ReachTargetConfig& target = reach.targets.emplace_back();
    target.vertices = read_selection(own["vertices"], file, at + "/vertices");
    target.position = read_keys(own["position"], file, at + "/position");
    if (target.position.empty()) target.position = {{0}, {read_vector(own["position"])}};
  }
  if (json.contains("lowest")) reach.lowest = read_numbers(json["lowest"]);
  if (json.contains("highest")) reach.highest = read_numbers(json["highest"]);
  reach.change = json.value("change", reach.change);
  reach.horizon = json.value("horizon", reach.horizon);
  return reach;
}

void read_gravity(const Json& json, const std::filesystem::path& file, const std::string& place, SceneConfig& scene) {
  if (!json.contains("gravity")) return;
  scene.gravity_keys = read_keys(json["gravity"], file, place + "/gravity");
  scene.gravity = read_strongest(json["gravity"], scene.gravity_keys);
}

/// Scene of one body from the shared members and those of `own`, at `place` of the file.
SceneConfig scene_of(const Json& shared, const Json& own, const std::filesystem::path& file, const std::string& place) {
  SceneConfig scene;
  scene.file = file;
  scene.place = place;
  scene.bundle = resolve_path(file, own["bundle"]);
  scene.time_step = shared.value("time_step", scene.time_step);
  scene.steps = shared.value("steps", scene.steps);
  read_gravity(own.contains("gravity") ? own : shared, file, own.contains("gravity") ? place : "", scene);
  scene.integrator = choice_or(shared, "integrator", scene.integrator);
  scene.internal_force = choice_or(own, "internal_force", scene.internal_force);
  scene.precision = choice_or(shared, "precision", scene.precision);
  const Json damping = member_or(shared, "damping", Json::object());
  scene.mass_damping = damping.value("mass", scene.mass_damping);
  scene.stiffness_damping = damping.value("stiffness", scene.stiffness_damping);
  const Json newton = member_or(shared, "newton", Json::object());
  scene.newton.max_iterations = newton.value("max_iterations", scene.newton.max_iterations);
  scene.newton.tolerance = newton.value("tolerance", scene.newton.tolerance);
  scene.space.space = choice_or(own.contains("space") ? own : shared, "space", scene.space.space);
  scene.space.release = (own.contains("space_release") ? own : shared).value("space_release", scene.space.release);
  scene.space.newton.max_iterations = newton.value("max_iterations", scene.space.newton.max_iterations);
  scene.space.newton.tolerance = newton.value("tolerance", scene.space.newton.tolerance);
  const Json sleep = member_or(shared, "sleep", Json::object());
  scene.sleep.energy = sleep.value("energy", scene.sleep.energy);
  scene.sleep.time = sleep.value("time", scene.sleep.time);
  if (own.contains("examples")) scene.examples = read_example_force(own["examples"], file, place + "/examples");
  scene.regions = read_region_forces(member_or(own, "regions", Json::array()), file, place);
  const Json forces = member_or(own, "forces", Json::array());
  for (std::size_t i = 0; i < forces.size(); ++i)
    scene.forces.push_back(read_vertex_force(forces[i], file, fmt::format("{}/forces/{}", place, i)));
  scene.body = read_body(member_or(own, "body", Json::object()), file, place + "/body");
  if (own.contains("reach")) scene.reach = read_reach(own["reach"], file, place + "/reach");
  if (scene.reach && scene.space.space == Space::kFull)
    throw InputError({file.string(), place + "/reach", "a body that steps in its modes, space \"reduced\" or \"auto\"",
                      "space \"full\"", ""});
  const Json obstacles = member_or(shared, "obstacles", Json::array());
  for (std::size_t i = 0; i < obstacles.size(); ++i)
    scene.obstacles.push_back(read_obstacle(obstacles[i], file, fmt::format("/obstacles/{}", i)));
  scene.meeting = read_meeting(own);
  scene.instances = shared.value("instances", scene.instances);
  const Json output = member_or(shared, "output", Json::object());
  if (output.contains("trajectory")) scene.trajectory = resolve_path(file, output["trajectory"]);
  scene.every = output.value("every", scene.every);
  scene.render = output.value("render", scene.render);
  return scene;
}

void check_scene(const Json& json, const std::filesystem::path& file) {
  check_against_schema(json, "scene", file);
  check_numbers(json, file);
  if (json.contains("bundle") == json.contains("bodies"))
    throw InputError({file.string(), "/", "bundle or bodies", json.contains("bundle") ? "both" : "neither", ""});
}

/// Members that a scene of several bodies has elsewhere, or not at all.
void refuse_members_of_one_body(const Json& json, const std::filesystem::path& file) {
  for (const char* name : {"internal_force", "examples", "regions", "forces", "body", "reach"})
    if (json.contains(name))
      throw InputError({file.string(), fmt::format("/{}", name), "no such member beside bodies", "one",
                        fmt::format("move it into the bodies that it is for: /bodies/0/{}", name)});
  if (json.contains("instances"))
    throw InputError(
        {file.string(), "/instances", "no such member beside bodies", "one", "give a body a \"grid\" or \"poses\""});
}

void check_name(const std::string& name, const std::filesystem::path& file, const std::string& place) {
  const auto allowed = [](char c) { return std::isalnum(static_cast<unsigned char>(c)) || c == '_' || c == '-'; };
  if (std::ranges::all_of(name, allowed)) return;
  throw InputError({file.string(), place + "/name", "letters, digits, _ and -", fmt::format("\"{}\"", name), ""});
}

/// Says of each kind whether others of its own, of another kind or parts of itself may touch its bodies, or hold them.
void set_meetings(WorldConfig& world) {
  for (BodiesConfig& own : world.bodies) {
    const auto is_met_by = [&](const BodiesConfig& other) {
      return (&other != &own || own.places.size() > 1) && own.scene.meeting.meets(other.scene.meeting);
    };
    own.scene.meets_bodies = world.contact.self || std::ranges::any_of(world.bodies, is_met_by);
  }
  for (BodiesConfig& own : world.bodies)
    for (const AttachmentConfig& attachment : own.scene.attachments) {
      if (!attachment.body) continue;
      own.scene.meets_bodies = true;
      world.bodies[attachment.body->kind].scene.meets_bodies = true;
    }
}

std::vector<BodyPlace> read_grid(const Json& grid) {
  const Eigen::Vector3d spacing = read_vector(grid["spacing"]);
  std::vector<BodyPlace> places;
  for (int z = 0; z < grid["counts"][2].get<int>(); ++z)
    for (int y = 0; y < grid["counts"][1].get<int>(); ++y)
      for (int x = 0; x < grid["counts"][0].get<int>(); ++x)
        places.push_back({spacing.cwiseProduct(Eigen::Vector3d(x, y, z)), Eigen::Quaterniond::Identity()});
  return places;
}

/// Places of a kind of bodies that follows `before` others.
std::vector<BodyPlace> read_places(const Json& own, const std::filesystem::path& file, const std::string& place,
                                   std::size_t before) {
  constexpr std::size_t kMostBodies = 100000;  // as many as a list of the schema has
  const auto require_room = [&](std::size_t count, const char* member) {
    if (before + count > kMostBodies)
      throw InputError({file.string(), place + member, fmt::format("at most {} bodies in a scene", kMostBodies),
                        fmt::format("{}", before + count), ""});
  };
  if (own.contains("grid") && own.contains("poses"))
    throw InputError({file.string(), place, "grid or poses", "both", ""});
  if (own.contains("grid")) {
    std::size_t count = 1;
    for (const Json& along : own["grid"]["counts"]) count *= along.get<std::size_t>();
    require_room(count, "/grid/counts");
    return read_grid(own["grid"]);
  }
  std::vector<BodyPlace> places{BodyPlace{}};
  if (own.contains("poses")) {
    const std::filesystem::path poses = resolve_path(file, own["poses"]);
    require_file(poses, file, place + "/poses", "a text file of poses");
    places = read_poses(poses);
  }
  require_room(places.size(), own.contains("poses") ? "/poses" : "");
  return places;
}

}  // namespace

SceneConfig scene_of(const Json& json, const std::filesystem::path& file) {
  check_scene(json, file);
  if (json.contains("bodies"))
    throw InputError({file.string(), "/bodies", "a scene of one body, by \"bundle\"", "one of several",
                      "run and bench of exmat-runtime step scenes of several; what is asked for here takes one of the "
                      "bodies as a scene of its own, with the \"bundle\" and members of that body at the root"});
  SceneConfig scene = scene_of(json, json, file, "");
  scene.attachments =
      std::move(read_attachments(json, file, {{"", static_cast<std::size_t>(scene.instances)}}).front());
  return scene;
}

SceneConfig load_scene(const std::filesystem::path& file) { return scene_of(read_json(file), file); }

WorldConfig load_world(const std::filesystem::path& file) { return world_of(read_json(file), file); }

WorldConfig world_of(const Json& json, const std::filesystem::path& file) {
  check_scene(json, file);
  if (!json.contains("bodies")) {
    WorldConfig world = world_of(scene_of(json, file));
    world.contact.release = member_or(json, "contact", Json::object()).value("release", world.contact.release);
    world.full_bodies = json.value("full_bodies", world.full_bodies);
    return world;
  }
  refuse_members_of_one_body(json, file);
  WorldConfig world;
  world.file = file;
  std::size_t count = 0;
  for (std::size_t i = 0; i < json["bodies"].size(); ++i) {
    const Json& own = json["bodies"][i];
    const std::string place = fmt::format("/bodies/{}", i);
    check_name(own["name"], file, place);
    BodiesConfig bodies{own["name"], scene_of(json, own, file, place), read_places(own, file, place, count)};
    count += bodies.places.size();
    if (std::ranges::find(world.bodies, bodies.name, &BodiesConfig::name) != world.bodies.end())
      throw InputError(
          {file.string(), place + "/name", "each name once", fmt::format("\"{}\" again", bodies.name), ""});
    bodies.scene.instances = static_cast<int>(bodies.places.size());
    world.bodies.push_back(std::move(bodies));
  }
  std::vector<NamedBodies> names;
  for (const BodiesConfig& bodies : world.bodies) names.push_back({bodies.name, bodies.places.size()});
  auto attachments = read_attachments(json, file, names);
  for (std::size_t i = 0; i < attachments.size(); ++i) world.bodies[i].scene.attachments = std::move(attachments[i]);
  const SceneConfig& shared = world.bodies.front().scene;
  world.time_step = shared.time_step;
  world.steps = shared.steps;
  world.trajectory = shared.trajectory;
  world.every = shared.every;
  const Json contact = member_or(json, "contact", Json::object());
  world.contact.stiffness = contact.value("stiffness", world.contact.stiffness);
  world.contact.damping = contact.value("damping", world.contact.damping);
  world.contact.friction = contact.value("friction", world.contact.friction);
  world.contact.self = contact.value("self", world.contact.self);
  world.contact.release = contact.value("release", world.contact.release);
  world.full_bodies = json.value("full_bodies", world.full_bodies);
  set_meetings(world);
  return world;
}

void require_files(const SceneConfig& scene) {
  if (!scene.pack)
    require_file(scene.bundle, scene.file, scene.place + "/bundle", "a bundle",
                 "make it with exmat-precompute bundle ASSET.json -o " + scene.bundle.filename().string());
  require_obstacle_files(scene);
}

std::vector<NamedFile> obstacle_files(const SceneConfig& scene) {
  std::vector<NamedFile> files;
  for (std::size_t i = 0; i < scene.obstacles.size(); ++i) {
    const auto& shape = scene.obstacles[i].shape;
    if (const auto* mesh = std::get_if<MeshConfig>(&shape))
      files.push_back({mesh->file, fmt::format("/obstacles/{}/mesh/file", i), "a surface"});
    if (const auto* heights = std::get_if<HeightFieldConfig>(&shape); heights && heights->file)
      files.push_back({*heights->file, fmt::format("/obstacles/{}/height_field/file", i), "a text file of heights"});
  }
  return files;
}

void require_obstacle_files(const SceneConfig& scene) {
  for (const auto& [file, place, kind] : obstacle_files(scene)) require_file(file, scene.file, place, kind);
}

std::vector<VertexForceConfig> forces_on_vertices(const SceneConfig& config, SelectablePoints points) {
  std::vector<VertexForceConfig> forces = config.forces;
  points.file = config.file.string();
  for (std::size_t i = 0; i < forces.size(); ++i) {
    if (!forces[i].places) continue;
    points.place = fmt::format("{}/forces/{}/vertices", config.place, i);
    const auto vertices = select_points(points, *forces[i].places);
    forces[i].vertices.assign(vertices.begin(), vertices.end());
    forces[i].places.reset();
  }
  return forces;
}

}  // namespace exmat
