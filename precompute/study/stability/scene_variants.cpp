#include "precompute/study/stability/scene_variants.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <functional>
#include <utility>

#include "common/mesh/geometry.h"
#include "precompute/study/stability/body_scale.h"

namespace exmat::precompute {
namespace {

using Change = std::function<void(WorldConfig&, double)>;

void scale(KeysConfig& keys, double factor) {
  for (Eigen::VectorXd& value : keys.values) value *= factor;
}

void change_time_step(WorldConfig& scene, double factor) {
  const auto change = [&](auto& config) {
    config.time_step *= factor;
    config.steps = std::max<std::int64_t>(1, std::llround(static_cast<double>(config.steps) / factor));
  };
  change(scene);
  for (BodiesConfig& kind : scene.bodies) change(kind.scene);
}

void change_load(WorldConfig& scene, double factor) {
  for (auto& [name, kind, places] : scene.bodies) {
    kind.gravity *= factor;
    scale(kind.gravity_keys, factor);
    for (VertexForceConfig& force : kind.forces) force.force *= factor;
  }
}

void change_speed(WorldConfig& scene, double factor) {
  for (auto& [name, kind, places] : scene.bodies)
    for (auto* velocity : {&kind.body.linear_velocity, &kind.body.angular_velocity})
      if (*velocity) **velocity *= factor;
}

std::vector<ExampleForceConfig*> example_forces(SceneConfig& kind) {
  std::vector<ExampleForceConfig*> forces;
  if (kind.examples) forces.push_back(&*kind.examples);
  for (RegionForceConfig& region : kind.regions) forces.push_back(&region.force);
  return forces;
}

void change_kappa(WorldConfig& scene, double factor) {
  for (auto& [name, kind, places] : scene.bodies)
    for (ExampleForceConfig* force : example_forces(kind)) {
      force->stiffness *= factor;
      scale(force->keys.stiffness, factor);
    }
}

void change_contact(WorldConfig& scene, double factor) {
  for (auto& [name, kind, places] : scene.bodies)
    for (ObstacleConfig& obstacle : kind.obstacles) obstacle.stiffness *= factor;
  scene.contact.stiffness *= factor;
}

/// The scene's own values.
struct Own {
  double time_step = 0, gravity = 0, force = 0, speed = 0, spin = 0, kappa = 0, contact = 0;

  explicit Own(WorldConfig scene) {
    for (auto& [name, kind, places] : scene.bodies) {
      time_step = kind.time_step;
      gravity = std::max(gravity, kind.gravity.norm());
      for (const VertexForceConfig& load : kind.forces)
        force = std::max(force, load.force.norm() * static_cast<double>(load.vertices.size()));
      const auto size = [](const std::optional<Eigen::Vector3d>& velocity) { return velocity ? velocity->norm() : 0; };
      speed = std::max(speed, size(kind.body.linear_velocity));
      spin = std::max(spin, size(kind.body.angular_velocity));
      for (const ExampleForceConfig* examples : example_forces(kind)) kappa = std::max(kappa, examples->stiffness);
      for (const ObstacleConfig& obstacle : kind.obstacles) contact = std::max(contact, obstacle.stiffness);
    }
    if (scene.is_list) contact = std::max(contact, scene.contact.stiffness);
  }
};

void add_variants(const WorldConfig& scene, std::initializer_list<double> factors, const Change& change,
                  SceneDimension& dimension) {
  for (const double factor : factors) {
    WorldConfig changed = scene;
    change(changed, factor);
    dimension.variants.push_back(
        {factor < 1 ? fmt::format("1/{:g} x", 1 / factor) : fmt::format("{:g} x", factor), factor, std::move(changed)});
  }
}

/// q of the pose nearest to the body whose longest side is multiplied by `factor`: 0 flat, -1 mirrored. Fixed vertices
/// stay about where they are.
Eigen::VectorXd squashed(const ReducedModel& data, double factor) {
  const VertexArray& vertices = data.object->mesh.vertices;
  const Eigen::RowVector3d low = vertices.colwise().minCoeff(), high = vertices.colwise().maxCoeff();
  Eigen::Index axis = 0;
  (high - low).maxCoeff(&axis);
  double fixed = 0, sum = 0;  // vertices that no mode moves
  for (Eigen::Index v = 0; v < vertices.rows(); ++v) {
    if (!data.modal->basis.middleRows<3>(3 * v).isZero(0)) continue;
    sum += vertices(v, axis);
    ++fixed;
  }
  const double middle = fixed > 0 ? sum / fixed : 0.5 * (low + high)[axis];
  VertexArray field = VertexArray::Zero(vertices.rows(), 3);
  field.col(axis) = (factor - 1) * (vertices.col(axis).array() - middle);
  return nearest_pose(data.modal->basis, field);
}

SceneDimension starts(const WorldConfig& scene, const SceneBodies& bodies) {
  using Pose = std::function<Eigen::VectorXd(const ReducedModel&)>;
  const std::pair<const char*, Pose> poses[] = {
      {"flat", [](const ReducedModel& data) { return squashed(data, 0); }},
      {"mirrored", [](const ReducedModel& data) { return squashed(data, -1); }},
      {"random", [](const ReducedModel& data) {
         return random_pose(data.modal->basis, bounding_box_diagonal(data.object->mesh.vertices));
       }}};
  SceneDimension dimension{.name = "start", .own = "as the scene has it"};
  for (const auto& [name, pose] : poses) {
    WorldConfig changed = scene;
    for (std::size_t i = 0; i < changed.bodies.size(); ++i) {
      BodyConfig& body = changed.bodies[i].scene.body;
      body.pose.reset();
      body.reduced = pose(bodies.kind(i).data);
    }
    dimension.variants.push_back({name, 0, std::move(changed)});
  }
  return dimension;
}

}  // namespace

std::vector<SceneDimension> scene_dimensions(const WorldConfig& scene, const SceneBodies& bodies) {
  const Own own(scene);
  std::vector<SceneDimension> dimensions;
  const auto add = [&](const char* name, std::string value, const char* left_out, std::initializer_list<double> factors,
                       const Change& change) {
    SceneDimension& dimension = dimensions.emplace_back(SceneDimension{.name = name, .own = std::move(value)});
    if (left_out == nullptr)
      add_variants(scene, factors, change, dimension);
    else
      dimension.left_out = left_out;
  };
  add("time step", fmt::format("{:.4g} s", own.time_step), nullptr, {0.25, 0.5, 2, 4, 8, 16}, change_time_step);
  add("load", fmt::format("gravity {:.4g} m/s^2, forces up to {:.4g} N", own.gravity, own.force),
      own.gravity + own.force > 0 ? nullptr : "the scene has neither gravity nor forces", {10, 100}, change_load);
  add("speed", fmt::format("{:.4g} m/s, {:.4g} rad/s", own.speed, own.spin),
      own.speed + own.spin > 0 ? nullptr : "no body moves at the start; a larger load makes a fall faster", {10, 100},
      change_speed);
  add("kappa", fmt::format("{:.4g}", own.kappa), own.kappa > 0 ? nullptr : "the scene has no example force", {10, 100},
      change_kappa);
  add("contact stiffness", fmt::format("{:.4g} N/m^3", own.contact),
      own.contact > 0 ? nullptr : "the scene has nothing to touch", {10, 100}, change_contact);
  dimensions.push_back(starts(scene, bodies));
  return dimensions;
}

}  // namespace exmat::precompute
