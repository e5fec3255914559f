#include "precompute/training/training_loads.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <fmt/ranges.h>

#include "common/core/error.h"

namespace exmat::precompute {
namespace {

constexpr double kUnknownStiffness = 40;  // times omega_1^2: example forces as strong as those of most scenes
constexpr double kDampingShare = 0.5;     // of the root of the stiffness, where a damping is not known
constexpr double kMostFall = 2;           // body sizes that a body falls before it touches

runtime::ExampleSettings settings_of(const ExampleForceConfig& force) {
  return {.stiffness = force.stiffness,
          .damping = force.damping,
          .bias = force.bias,
          .elastic = force.law == ExampleForceLaw::kElastic};
}

// None of a scene that does not name the group.
runtime::ExampleSettings settings_of(const SceneConfig& scene, const std::string& group) {
  if (group.empty()) return scene.examples ? settings_of(*scene.examples) : runtime::ExampleSettings{};
  const auto found = std::ranges::find(scene.regions, group, &RegionForceConfig::name);
  return found == scene.regions.end() ? runtime::ExampleSettings{} : settings_of(found->force);
}

std::string text_of(const Eigen::Vector3d& v) { return fmt::format("{} {} {}", v[0], v[1], v[2]); }

// The velocity that a body has when it touches: its own, or what it falls with.
Eigen::Vector3d velocity_at_contact(const SceneConfig& scene, const TrainingBody& body) {
  const Eigen::Vector3d own = scene.body.linear_velocity.value_or(Eigen::Vector3d::Zero());
  const double gravity = scene.gravity.norm(), duration = scene.time_step * static_cast<double>(scene.steps);
  const double height = std::min(0.5 * gravity * duration * duration, kMostFall * body.size);
  const double fall = std::sqrt(2 * gravity * height);
  if (fall == 0) return own;
  return own + fall * scene.gravity / gravity;
}

}  // namespace

bool TrainingLoads::deforms(bool free) const {
  return (!free && gravity.norm() > 0) || !forces.empty() || patches || (free && obstacle && velocity.norm() > 0) ||
         std::ranges::any_of(examples, runtime::acts);
}

TrainingLoads scene_loads(const SceneConfig& scene, const TrainingBody& body) {
  TrainingLoads loads;
  loads.gravity = scene.gravity;
  loads.any_gravity = !scene.body.motion.empty();
  if (loads.any_gravity && loads.gravity.isZero(0)) loads.gravity = 9.81 * Eigen::Vector3d::UnitZ();
  loads.forces = scene.forces;
  for (const std::string& group : body.groups) loads.examples.push_back(settings_of(scene, group));
  if (!scene.obstacles.empty()) {
    const ObstacleConfig& first = scene.obstacles.front();
    loads.obstacle = {first.stiffness, first.damping, first.friction};
    loads.velocity = velocity_at_contact(scene, body);
    loads.patches = !body.free;
  }
  loads.mass_damping = scene.mass_damping;
  loads.stiffness_damping = scene.stiffness_damping;
  loads.duration = scene.time_step * static_cast<double>(scene.steps);
  if (!body.free) return loads;
  loads.spin = scene.body.angular_velocity.value_or(loads.spin);
  loads.orientation = scene.body.orientation.value_or(loads.orientation);
  return loads;
}

TrainingLoads unknown_loads(const TrainingBody& body) {
  TrainingLoads loads;
  loads.any_gravity = true;
  loads.patches = true;
  loads.any_stiffness = true;
  const double stiffness = kUnknownStiffness * body.angular_frequency * body.angular_frequency;
  loads.examples.assign(body.groups.size(), {stiffness, kDampingShare * std::sqrt(stiffness), 0.8});
  if (!body.free) loads.gravity = 9.81 * Eigen::Vector3d::UnitZ();
  return loads;
}

TrainingLoads declared_loads(const LoadsConfig& declared, const std::vector<std::vector<std::int64_t>>& forces,
                             const TrainingBody& body) {
  TrainingLoads loads = unknown_loads(body);
  loads.patches = false;
  loads.any_direction = true;
  loads.any_gravity = false;
  loads.gravity = declared.gravity;
  for (std::size_t i = 0; i < forces.size(); ++i)
    loads.forces.push_back({forces[i], Eigen::Vector3d(0, 0, declared.forces[i].force), 0, 1});
  for (runtime::ExampleSettings& examples : loads.examples) {
    if (declared.example_stiffness) {
      examples.stiffness = *declared.example_stiffness;
      examples.damping = kDampingShare * std::sqrt(examples.stiffness);
      loads.any_stiffness = false;
    }
    examples.damping = declared.example_damping.value_or(examples.damping);
    examples.bias = declared.example_bias.value_or(examples.bias);
  }
  if (declared.speed > 0 && body.free) {
    loads.obstacle = TrainingObstacle{ObstacleConfig{}.stiffness, 0, 0.5};
    loads.velocity = declared.speed * Eigen::Vector3d::UnitX();
  }
  return loads;
}

TrainingPlan plan_training(const TrainingConfig& config, const SceneConfig* scene,
                           const std::vector<std::vector<std::int64_t>>& forces, const TrainingBody& body) {
  if (config.from == Training::kNone) return {{}, false, "basis.training is \"none\""};
  const bool of_scene = config.from == Training::kScene || (config.from == Training::kAuto && scene != nullptr);
  if (of_scene && scene == nullptr)
    throw InputError({"", "/basis/training", "a scene, for its loads", "none", "name one by --scene"});
  if (of_scene) {
    TrainingPlan plan{scene_loads(*scene, body), false, kLoadsOfScene};
    if (!plan.loads.deforms(body.free)) return {{}, false, "nothing in the scene deforms the body"};
    return plan;
  }
  if (config.loads) return {declared_loads(*config.loads, forces, body), true, "the loads of the asset"};
  if (body.groups.empty()) return {{}, false, "no loads are known"};
  return {unknown_loads(body), true, "examples, gravity and pushes of all kinds, since no loads are known"};
}

std::vector<LoadKind> kinds_of(const TrainingLoads& loads, bool free) {
  TrainingLoads none = loads;
  none.gravity.setZero();
  none.forces.clear();
  none.patches = false;
  for (runtime::ExampleSettings& examples : none.examples) examples.stiffness = examples.damping = 0;
  none.obstacle.reset();
  std::vector<LoadKind> kinds;
  const auto add = [&](bool acts, const char* name, const auto& put) {
    if (acts) put(kinds.emplace_back(LoadKind{name, none}).loads);
  };
  add(!free && loads.gravity.norm() > 0, kGravity, [&](TrainingLoads& one) { one.gravity = loads.gravity; });
  add(std::ranges::any_of(loads.examples, runtime::acts), "example forces",
      [&](TrainingLoads& one) { one.examples = loads.examples; });
  add(!loads.forces.empty() || loads.patches, "forces on vertices", [&](TrainingLoads& one) {
    one.forces = loads.forces;
    one.patches = loads.patches;
  });
  add(free && loads.obstacle && loads.velocity.norm() > 0, "throws",
      [&](TrainingLoads& one) { one.obstacle = loads.obstacle; });
  return kinds;
}

std::string text_of(const TrainingLoads& loads) {
  std::string text = fmt::format("gravity {} {}\ndirections {} patches {} stiffness {}\n", text_of(loads.gravity),
                                 loads.any_gravity, loads.any_direction, loads.patches, loads.any_stiffness);
  for (const VertexForceConfig& force : loads.forces)
    text += fmt::format("force {} of {}, {} to {}\n", text_of(force.force), force.vertices, force.start, force.end);
  for (const runtime::ExampleSettings& examples : loads.examples)
    text += fmt::format("examples {} {} {}{}\n", examples.stiffness, examples.damping, examples.bias,
                        examples.elastic ? " elastic" : "");
  if (loads.obstacle)
    text += fmt::format("obstacle {} {} {}\n", loads.obstacle->stiffness, loads.obstacle->damping,
                        loads.obstacle->friction);
  return text + fmt::format("velocity {} spin {} orientation {} {}\ndamping {} {} duration {}\n",
                            text_of(loads.velocity), text_of(loads.spin), loads.orientation.w(),
                            text_of(loads.orientation.vec()), loads.mass_damping.value_or(-1),
                            loads.stiffness_damping.value_or(-1), loads.duration);
}

}  // namespace exmat::precompute
