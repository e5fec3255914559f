#include "common/config/scene_needs.h"

#include <string>

#include "common/core/error.h"

namespace exmat {

WorldConfig world_of(SceneConfig scene) {
  WorldConfig world;
  world.file = scene.file;
  world.is_list = false;
  world.time_step = scene.time_step;
  world.steps = scene.steps;
  world.trajectory = scene.trajectory;
  world.every = scene.every;
  std::vector<BodyPlace> places(static_cast<std::size_t>(scene.instances));
  world.bodies.push_back({"", std::move(scene), std::move(places)});
  return world;
}

void set_trajectory(const std::optional<std::filesystem::path>& file, WorldConfig& world) {
  world.trajectory = file;
  for (BodiesConfig& bodies : world.bodies) bodies.scene.trajectory = file;
}

void require_weights(const SceneConfig& scene, const std::vector<Eigen::Index>& examples) {
  auto expected = examples.begin();
  const auto require = [&](const ExampleForceConfig& force, const std::string& member) {
    const Eigen::Index count = *expected++;
    if (!force.weights || force.weights->size() == count) return;
    throw InputError({scene.file.string(), scene.place + '/' + member + "/weights",
                      std::to_string(count) + " numbers, one for each example of " + scene.bundle.string(),
                      std::to_string(force.weights->size()), "the first is that of the rest pose"});
  };
  if (scene.examples) require(*scene.examples, "examples");
  for (std::size_t i = 0; i < scene.regions.size(); ++i)
    require(scene.regions[i].force, "regions/" + std::to_string(i));
}

void require_uncompensated(const SceneConfig& scene) {
  if (!scene.examples || !scene.examples->compensate) return;
  throw InputError({scene.file.string(), scene.place + "/examples/compensate", "no such member of a body on bones",
                    "true", "its targets are those of its modes, in which it does not step: leave compensate out"});
}

Needs needs_of(const SceneConfig& scene) {
  Needs needs{.examples = scene.examples || scene.body.pose,
              .carried = !scene.body.motion.empty(),
              .targets = scene.examples && scene.examples->target != TargetSource::kSolve,
              .target_elasticity = scene.examples && scene.examples->law == ExampleForceLaw::kElastic,
              .full_space = scene.space.space != Space::kReduced || scene.body.animation || !scene.body.bones.empty(),
              .contact = scene.meets_others || scene.meets_bodies || !scene.obstacles.empty(),
              .render = scene.render,
              .internal_force = scene.internal_force};
  if (scene.examples) needs.energy_reference = scene.examples->energy_reference;
  std::vector<RegionNeeds>& regions = needs.regions.emplace();
  for (const auto& [name, force] : scene.regions)
    regions.push_back({.name = name,
                       .targets = force.target != TargetSource::kSolve,
                       .energy_reference = force.energy_reference,
                       .target_elasticity = force.law == ExampleForceLaw::kElastic,
                       .full_space = needs.full_space});
  return needs;
}

}  // namespace exmat
