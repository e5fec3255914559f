#include "runtime/scene/world_loader.h"

#include <fmt/format.h>

#include "common/core/error.h"
#include "runtime/scene/attachment_loader.h"
#include "runtime/scene/obstacle_loader.h"

namespace exmat::runtime {
namespace {

void check_places(const WorldConfig& config, const BodiesConfig& bodies, bool constrained) {
  if (!config.is_list || !constrained || bodies.places.size() == 1) return;
  throw InputError({bodies.scene.file.string(), bodies.scene.place, "one place for a body with fixed vertices",
                    fmt::format("{} places", bodies.places.size()),
                    "an asset without \"fixed\" makes free bodies, which a grid may place"});
}

}  // namespace

State start_of(const LoadedScene& kind, const LoadedBody& body) {
  State state = kind.start;
  const BodyPlace& place = body.place;
  if (!place.position.isZero(0) || place.orientation.coeffs() != Eigen::Quaterniond::Identity().coeffs()) {
    FrameMotion motion = kind.model->frame->motion(state.frame);
    motion.position += place.position;
    motion.orientation = place.orientation * motion.orientation;
    set_motion(*kind.model, motion, state);
  }
  hold_body(kind, body.number, state);
  return state;
}

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
  world.obstacles = make_obstacles(config.bodies.front().scene.obstacles, config.contact.release);
  for (const BodiesConfig& bodies : config.bodies) {
    LoadedKind& kind = world.kinds.emplace_back(LoadedKind{load_run(bodies.scene, &world.obstacles), nullptr});
    const LoadedScene& loaded = kind.loaded;
    check_places(config, bodies, loaded.summary.constrained);
    if (bodies.scene.meets_bodies) kind.surface = touching_surface(*loaded.model, loaded.data, config.contact.self);
    for (std::size_t i = 0; i < bodies.places.size(); ++i) {
      const bool has_number = config.is_list && bodies.places.size() > 1;
      world.bodies.push_back({has_number ? fmt::format("{}_{}", bodies.name, i) : bodies.name, world.kinds.size() - 1,
                              i, bodies.places[i]});
    }
  }
  return world;
}

}  // namespace exmat::runtime
