#pragma once

#include <memory>
#include <string>
#include <vector>

#include "common/config/scene_config.h"
#include "runtime/scene/scene_loader.h"
#include "runtime/sim/contact/body_contact.h"

namespace exmat::runtime {

/// Bodies of one kind, ready to step.
struct LoadedKind {
  LoadedScene loaded;
  std::shared_ptr<const TouchingSurface> surface;  ///< null: they touch no other body and not themselves
};

/// A body of a loaded scene.
struct LoadedBody {
  std::string name;        ///< that of its kind, with its number where there are several: teddy_12
  std::size_t kind = 0;    ///< in LoadedWorld::kinds
  std::size_t number = 0;  ///< among those of its kind
  BodyPlace place{};
};

/// All bodies of a scene, ready to step.
struct LoadedWorld {
  std::vector<LoadedKind> kinds;
  std::vector<LoadedBody> bodies;
  Obstacles obstacles;  ///< all of the scene
};

/// Reads the bundles. Throws InputError as load_run, and where bodies that do not move freely are to be in several
/// places.
LoadedWorld load_world_run(const WorldConfig& config);

/// The start of a body of a kind by itself. Throws InputError where what is to hold it cannot.
State start_of(const LoadedScene& kind, const LoadedBody& body = {});

/// The starts of all bodies, with what holds them together. Throws InputError likewise.
std::vector<State> starts_of(const LoadedWorld& world);

/// The surface of bodies of a model, from what /object and /modal of its bundle hold.
std::shared_ptr<const TouchingSurface> touching_surface(const Model& model, const ReducedModel& data,
                                                        bool meets_itself);

}  // namespace exmat::runtime
