#include "runtime/scene/world_loader.h"

#include <fmt/format.h>

#include "common/core/error.h"

namespace exmat::runtime {
namespace {

/// The start of a body of a kind at one of its places.
State start_at(const LoadedScene& loaded, const BodyPlace& place) {
  State state = loaded.start;
  FrameMotion motion = loaded.model->frame->motion(state.frame);
  motion.position += place.position;
  motion.orientation = place.orientation * motion.orientation;
  FrameWorkspace workspace = loaded.model->frame->make_workspace();
  loaded.model->frame->set_motion(motion, state.q, state.v, workspace, state.frame);
  return state;
}

void check_places(const BodiesConfig& bodies, bool constrained) {
  if (!constrained || bodies.places.size() == 1) return;
  throw InputError({bodies.scene.file.string(), bodies.scene.place, "one place for a body with fixed vertices",
                    fmt::format("{} places", bodies.places.size()),
                    "an asset without \"fixed\" makes free bodies, which a grid may place"});
}

}  // namespace

std::shared_ptr<const TouchingSurface> touching_surface(const Model& model, const ReducedModel& data,
                                                        bool meets_itself) {
  const TetMesh& mesh = data.object->mesh;
  return std::make_shared<TouchingSurface>(
      *model.contact, BodySurface::of_tets(mesh.tets, mesh.vertices, data.modal->basis, model.frame->origin()),
      meets_itself);
}

LoadedWorld load_world_run(const WorldConfig& config) {
  LoadedWorld world;
  world.kinds.reserve(config.bodies.size());
  for (const BodiesConfig& bodies : config.bodies) {
    LoadedKind& kind = world.kinds.emplace_back(LoadedKind{load_run(bodies.scene), nullptr});
    const LoadedScene& loaded = kind.loaded;
    check_places(bodies, loaded.summary.constrained);
    kind.surface = touching_surface(*loaded.model, loaded.data, config.contact.self);
    for (std::size_t i = 0; i < bodies.places.size(); ++i) {
      const bool alone = bodies.places.size() == 1;
      world.bodies.push_back({alone ? bodies.name : fmt::format("{}_{}", bodies.name, i), world.kinds.size() - 1,
                              start_at(loaded, bodies.places[i])});
    }
  }
  return world;
}

World make_world(const LoadedWorld& loaded, const WorldConfig& config, std::span<const StepScene> scenes) {
  std::vector<WorldBodyStart> bodies;
  for (const LoadedBody& body : loaded.bodies) {
    const LoadedKind& kind = loaded.kinds[body.kind];
    const StepScene& scene = scenes.empty() ? kind.loaded.scene : scenes[body.kind];
    bodies.push_back({{kind.loaded.model.get(), &scene, kind.surface}, body.start});
  }
  return {std::move(bodies), {config.contact.stiffness, config.contact.damping, config.contact.friction}};
}

}  // namespace exmat::runtime
