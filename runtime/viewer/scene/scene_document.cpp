#include "runtime/viewer/scene/scene_document.h"

#include <algorithm>
#include <fmt/format.h>

#include "common/config/json_file.h"
#include "common/core/atomic_file.h"
#include "common/core/error.h"

namespace exmat::viewer {
namespace {

constexpr double kDrawnTo = 1000;  ///< kappa that a bundle without a scene is shown with [1/s^2]

/// A scene for a bundle alone: its examples act, and it hangs or falls.
Json scene_of_bundle(const std::filesystem::path& bundle) {
  const exmat_bundle_info info = bundle_info(bundle.string());
  Json scene{{"bundle", bundle.filename().string()}, {"damping", {{"mass", 0.5}, {"stiffness", 0.005}}}};
  if (info.examples > 0) scene["examples"] = {{"stiffness", kDrawnTo}, {"damping", 10}};
  Json regions = Json::array();
  for (std::int64_t region = 0; region < info.regions; ++region)
    regions.push_back({{"name", bundle_region_name(bundle.string(), static_cast<std::size_t>(region))},
                       {"stiffness", kDrawnTo},
                       {"damping", 10}});
  if (!regions.empty()) scene["regions"] = regions;
  return scene;
}

bool is_bundle(const std::filesystem::path& file) { return file.extension() == ".h5" || file.extension() == ".hdf5"; }

/// A setting, or what it begins with where the scene keys it in time; such a one is left to its keys.
bool is_keyed(const Json& json, const char* name) { return json.contains(name) && json[name].is_object(); }
template <typename T>
T value_of(const Json& json, const char* name, const T& fallback) {
  if (!json.contains(name)) return fallback;
  return is_keyed(json, name) ? json[name]["keys"][0]["value"].get<T>() : json[name].get<T>();
}

ForceSettings force_of(const Json& json) {
  ForceSettings force;
  force.region = json.value("name", std::string());
  force.stiffness = value_of(json, "stiffness", force.stiffness);
  force.damping = value_of(json, "damping", force.damping);
  force.bias = value_of(json, "bias", force.bias);
  force.target = json.value("target", force.target);
  force.law = json.value("force", force.law);
  force.given = json.contains("weights");
  if (force.given) force.weights = value_of(json, "weights", force.weights);
  force.keyed = is_keyed(json, "weights");
  force.on = force.stiffness > 0 || force.damping > 0;
  return force;
}

/// Members at their defaults are left as they are, there or not.
template <typename T>
void put(Json& json, const char* name, const T& value, const T& fallback) {
  if (is_keyed(json, name)) return;
  if (json.contains(name) || value != fallback) json[name] = value;
}

void put_force(Json& json, const ForceSettings& force) {
  const ForceSettings fallback;
  put(json, "stiffness", force.on ? force.stiffness : 0, -1.0);
  put(json, "damping", force.on ? force.damping : 0, fallback.damping);
  put(json, "bias", force.bias, fallback.bias);
  put(json, "target", force.target, fallback.target);
  put(json, "force", force.law, fallback.law);
  if (force.keyed) return;
  json.erase("weights");
  if (!force.given) return;
  json["weights"] = force.weights;
  json.erase("bias");  // which does not act on them
}

Json numbers(const double* values, int count) { return std::vector<double>(values, values + count); }

Json shape_of(const exmat_obstacle& obstacle) {
  const Json point = numbers(obstacle.point, 3);
  switch (obstacle.shape) {
    case EXMAT_SPHERE:
      return {{"sphere", {{"center", point}, {"radius", obstacle.radius}}}};
    case EXMAT_BOX:
      return {{"box",
               {{"center", point},
                {"half_extents", numbers(obstacle.half_extents, 3)},
                {"orientation", numbers(obstacle.orientation, 4)}}}};
    case EXMAT_CAPSULE: {
      double end[3];
      for (int i = 0; i < 3; ++i) end[i] = obstacle.point[i] + obstacle.direction[i];
      return {{"capsule", {{"start", point}, {"end", numbers(end, 3)}, {"radius", obstacle.radius}}}};
    }
    default:
      return {{"plane", {{"point", point}, {"normal", numbers(obstacle.direction, 3)}}}};
  }
}

Json obstacle_json(const PlacedObstacle& placed, const Json& scene) {
  const bool of_scene = placed.number >= 0;
  Json json = of_scene ? scene["obstacles"][static_cast<std::size_t>(placed.number)] : shape_of(placed.obstacle);
  json["stiffness"] = placed.obstacle.stiffness;
  put(json, "damping", placed.obstacle.damping, 0.0);
  put(json, "friction", placed.obstacle.friction, 0.0);
  if (placed.moved)
    json["motion"] = Json::array({{{"time", 0},
                                   {"position", numbers(placed.motion.position, 3)},
                                   {"orientation", numbers(placed.motion.orientation, 4)}}});
  return json;
}

/// Calls `act` with the name of each file that a scene names, wherever in it.
template <typename Act>
void for_each_file(Json& json, const Act& act) {
  for (const auto& [member, value] : json.items()) {
    const bool is_file = member == "bundle" || member == "poses" || member == "file";
    if (json.is_object() && is_file && value.is_string())
      act(value);
    else if (value.is_structured())
      for_each_file(value, act);
  }
}

bool moves_by_script(const Json& json) {
  return json.contains("forces") || (json.contains("body") && json["body"].contains("motion"));
}

}  // namespace

bool same_model(const Settings& a, const Settings& b) {
  if ((a.space == "reduced") != (b.space == "reduced")) return false;
  if (a.time_step != b.time_step || a.internal_force != b.internal_force || a.forces.size() != b.forces.size())
    return false;
  for (std::size_t i = 0; i < a.forces.size(); ++i)
    if (a.forces[i].target != b.forces[i].target || a.forces[i].law != b.forces[i].law ||
        a.forces[i].keyed != b.forces[i].keyed)
      return false;
  return true;
}

SceneDocument SceneDocument::open(const std::filesystem::path& file) {
  if (is_bundle(file)) return {file, scene_of_bundle(file), false};
  Json json = read_json(file);
  check_against_schema(json, "scene", file);
  if (!json.contains("bundle") && !json.contains("bodies"))
    throw InputError({file.string(), "/", "bundle or bodies", "neither", ""});
  return {file, std::move(json), true};
}

SceneDocument SceneDocument::with_bundle(const std::filesystem::path& bundle) const {
  if (is_world())
    throw InputError({bundle.string(), "", "no other bundle beside a scene of several bodies", "one",
                      "its bodies touch each other: add it to \"bodies\" of " + path_.string()});
  SceneDocument other(bundle, scene_of_bundle(bundle), false);
  Json& json = other.json_;
  for (const char* name : {"time_step", "gravity", "integrator", "damping", "newton", "obstacles"})
    if (json_.contains(name)) json[name] = json_[name];
  if (json.contains("examples") && json_.contains("examples")) {
    json["examples"] = json_["examples"];
    json["examples"].erase("weights");
  }
  return other;
}

std::string SceneDocument::kind_name(std::size_t kind) const {
  return is_world() ? of_kind(kind)["name"].get<std::string>() : bundle().stem().string();
}

std::filesystem::path SceneDocument::bundle(std::size_t kind) const {
  return path_.parent_path() / of_kind(kind)["bundle"].get<std::string>();
}

bool SceneDocument::has_scripted_motion() const {
  for (std::size_t kind = 0; kind < kinds(); ++kind)
    if (moves_by_script(of_kind(kind))) return true;
  if (!json_.contains("obstacles")) return false;
  return std::ranges::any_of(json_["obstacles"], [](const Json& obstacle) { return obstacle.contains("motion"); });
}

Settings SceneDocument::settings(std::size_t kind) const {
  const Json& own = of_kind(kind);
  Settings settings;
  settings.own_gravity = is_world() && own.contains("gravity");
  settings.time_step = json_.value("time_step", settings.time_step);
  settings.gravity = value_of(settings.own_gravity ? own : json_, "gravity", settings.gravity);
  if (json_.contains("damping")) {
    settings.mass_damping = json_["damping"].value("mass", 0.0);
    settings.stiffness_damping = json_["damping"].value("stiffness", 0.0);
  }
  settings.integrator = json_.value("integrator", settings.integrator);
  settings.internal_force = own.value("internal_force", settings.internal_force);
  settings.space = own.value("space", json_.value("space", settings.space));
  if (own.contains("examples")) settings.forces.push_back(force_of(own["examples"]));
  if (own.contains("regions"))
    for (const Json& region : own["regions"]) settings.forces.push_back(force_of(region));
  return settings;
}

void SceneDocument::prefer_space(const char* space) {
  if (!json_.contains("space")) json_["space"] = space;
}

void SceneDocument::set(const Settings& settings, std::size_t kind) {
  Json& own = of_kind(kind);
  const Settings fallback;
  put(json_, "time_step", settings.time_step, fallback.time_step);
  put(settings.own_gravity ? own : json_, "gravity", settings.gravity, fallback.gravity);
  if (!json_.contains("damping") && (settings.mass_damping > 0 || settings.stiffness_damping > 0))
    json_["damping"] = Json::object();
  if (json_.contains("damping")) {
    put(json_["damping"], "mass", settings.mass_damping, 0.0);
    put(json_["damping"], "stiffness", settings.stiffness_damping, 0.0);
  }
  put(json_, "integrator", settings.integrator, fallback.integrator);
  put(own, "internal_force", settings.internal_force, fallback.internal_force);
  put(own, "space", settings.space, json_.value("space", fallback.space));
  std::size_t region = 0;
  for (const ForceSettings& force : settings.forces)
    put_force(force.region.empty() ? own["examples"] : own["regions"][region++], force);
}

std::vector<std::filesystem::path> SceneDocument::files() const {
  std::vector<std::filesystem::path> files;
  Json json = json_;
  for_each_file(json, [&](const Json& name) { files.push_back(path_.parent_path() / name.get<std::string>()); });
  return files;
}

void SceneDocument::save(const std::filesystem::path& file, std::int64_t steps,
                         std::span<const PlacedObstacle> obstacles) const {
  Json json = json_;
  json["steps"] = std::max<std::int64_t>(steps, 1);
  json.erase("obstacles");
  for (const PlacedObstacle& placed : obstacles) json["obstacles"].push_back(obstacle_json(placed, json_));
  const auto folder = std::filesystem::absolute(file).parent_path();
  for_each_file(json, [&](Json& name) {
    const auto whole = std::filesystem::absolute(path_.parent_path() / name.get<std::string>());
    name = std::filesystem::proximate(whole, folder).generic_string();
  });
  check_against_schema(json, "scene", file);
  write_file_atomically(file, json.dump(2) + "\n");
}

}  // namespace exmat::viewer
