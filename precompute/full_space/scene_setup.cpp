#include "precompute/full_space/scene_setup.h"

#include <string>
#include <utility>

#include "common/bundle/scene_places.h"
#include "common/config/scene_needs.h"
#include "common/core/error.h"

namespace exmat::precompute {
namespace {

void require_supported(const SceneConfig& config, const std::vector<VertexForceConfig>& forces,
                       const FullSpaceModel& model) {
  const std::string file = config.file.string();
  const auto require_no_drivers = [&](const std::string& member, const ExampleForceConfig& force) {
    if (!force.drivers.empty())
      throw InputError({file, member + "/drivers",
                        "no drivers: weights of the full-space reference are given or those of the shape", "some", ""});
  };
  if (config.examples) require_no_drivers("/examples", *config.examples);
  if (config.examples && config.examples->compensate)
    throw InputError({file, "/examples/compensate", "false: targets of the full-space reference are not compensated",
                      "true", "compare with a bundle made without it"});
  if (!config.body.motion.empty())
    throw InputError({file, "/body/motion", "no motion: the full-space reference carries no bodies", "one", ""});
  if (!config.attachments.empty())
    throw InputError({file, config.attachments.front().place,
                      "no attachment: nothing holds a body of the full-space reference", "one",
                      "let the asset fix these vertices"});
  if (config.reach)
    throw InputError({file, "/reach", "no reach: the full-space reference chooses no weights", "one",
                      "give it the weights that a run has chosen: examples.weights with keys"});
  const auto require_part = [&](bool needed, bool there, const char* group) {
    if (needed && !there)
      throw InputError({config.bundle.string(), group, "this group, since the scene needs it", "none",
                        "precompute the bundle again with this scene (--scene)"});
  };
  require_part(!config.obstacles.empty(), model.matrix_free.contacts.has_value(), "/contact");
  const std::size_t groups = (config.examples ? 1 : 0) + config.regions.size();
  require_part(groups > 0, model.examples.size() == groups, config.examples ? "/examples" : "/regions");
  std::vector<Eigen::Index> examples;
  for (const FullSpaceExamples& own : model.examples) examples.push_back(own.count());
  require_weights(config, examples);
  for (std::size_t i = 0; i < forces.size(); ++i)
    for (const std::int64_t vertex : forces[i].vertices)
      if (vertex < 0 || vertex >= model.rest.rows())
        throw InputError({file, "/forces/" + std::to_string(i) + "/vertices",
                          "vertices of the object, 0 to " + std::to_string(model.rest.rows() - 1),
                          std::to_string(vertex), ""});
}

}  // namespace

FullSpaceScene full_space_scene(const SceneConfig& config, runtime::Obstacles obstacles, const FullSpaceModel& model) {
  FullSpaceScene scene;
  scene.forces = forces_on_vertices(config);
  require_supported(config, scene.forces, model);
  scene.time_step = config.time_step;
  scene.integrator = config.integrator;
  scene.mass_damping = config.mass_damping;
  scene.stiffness_damping = config.stiffness_damping;
  scene.gravity = config.gravity;
  scene.obstacles = std::move(obstacles);
  const auto add = [&](const ExampleForceConfig& force) {
    scene.examples.push_back({.stiffness = force.stiffness,
                              .damping = force.damping,
                              .bias = force.bias,
                              .elastic = force.law == ExampleForceLaw::kElastic,
                              .given_weights = force.weights.value_or(Eigen::VectorXd())});
  };
  if (config.examples) add(*config.examples);
  for (const RegionForceConfig& region : config.regions) add(region.force);
  return scene;
}

FullSpaceOptions full_space_options(const SceneConfig& config) {
  FullSpaceOptions options;
  options.whole_body = config.examples.has_value();
  if (config.examples) options.energy_reference = config.examples->energy_reference;
  for (const auto& [name, force] : config.regions) options.regions.push_back({name, force.energy_reference});
  return options;
}

FullSpaceState full_space_start(const SceneConfig& config, const FullSpaceModel& model,
                                const Eigen::VectorXd& deformation) {
  const BodyConfig& body = config.body;
  const bool moves = body.position || body.orientation || body.linear_velocity || body.angular_velocity;
  if (!model.frame && moves)
    throw InputError(
        {config.file.string(), "/body", "no position, orientation or velocity of a clamped body", "some", ""});
  if (!model.frame) return make_full_space_state(model, deformation, Eigen::VectorXd::Zero(deformation.size()));
  runtime::FrameMotion motion;
  motion.position = body.position.value_or(motion.position);
  motion.orientation = body.orientation.value_or(motion.orientation);
  motion.linear_velocity = body.linear_velocity.value_or(motion.linear_velocity);
  motion.angular_velocity = body.angular_velocity.value_or(motion.angular_velocity);
  return make_full_space_state(model, deformation, motion);
}

}  // namespace exmat::precompute
