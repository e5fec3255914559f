#include "runtime/scene/world_loader.h"

#include <algorithm>
#include <fmt/format.h>

#include "common/config/scene_needs.h"
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

/// The patch of the body that holds.
void load_other_end(const WorldConfig& config, const AttachmentConfig& attachment, LoadedWorld& world,
                    LoadedOtherEnd& other) {
  LoadedScene& kind = world.kinds[other.kind].loaded;
  const bool in_modes = steps_in_modes(kind.full.get(), kind.scene);
  other.patch =
      std::make_shared<Patch>(load_patch(config.bodies[other.kind].scene, *kind.data.object, attachment.body->vertices,
                                         attachment.place + "/to/vertices", in_modes, kind));
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

std::vector<State> starts_of(const LoadedWorld& world) {
  std::vector<State> states;
  for (const LoadedBody& body : world.bodies) states.push_back(start_of(world.kinds[body.kind].loaded, body));
  const auto end_of = [&](std::size_t body, const Patch& patch) {
    const LoadedKind& kind = world.kinds[world.bodies[body].kind];
    return End{*kind.loaded.model, kind.loaded.full.get(), kind.loaded.scene, kind.surface != nullptr, patch,
               states[body]};
  };
  for (std::size_t i = 0; i < states.size(); ++i)
    for (const LoadedAttachment* const own :
         attachments_of(world.kinds[world.bodies[i].kind].loaded, world.bodies[i].number)) {
      if (!own->other) continue;
      const auto is_other = [&](const LoadedBody& body) {
        return body.kind == own->other->kind && body.number == own->other->number;
      };
      const auto other = std::ranges::find_if(world.bodies, is_other) - world.bodies.begin();
      Attachment attachment = own->attachment;
      attachment.id = std::ssize(states[i].attachments);
      if (const auto fault =
              hold_together(end_of(i, *own->patch), end_of(static_cast<std::size_t>(other), *own->other->patch),
                            static_cast<int>(other), std::move(attachment), states[i]))
        throw InputError(
            {own->file, fmt::format("{}/{}", own->place, fault->member), fault->expected, fault->found, ""});
    }
  return states;
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
  require_files(config.bodies.front().scene);
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
  for (std::size_t i = 0; i < world.kinds.size(); ++i)
    for (std::size_t k = 0; k < world.kinds[i].loaded.attachments.size(); ++k)
      if (auto& other = world.kinds[i].loaded.attachments[k].other)
        load_other_end(config, config.bodies[i].scene.attachments[k], world, *other);
  return world;
}

}  // namespace exmat::runtime
