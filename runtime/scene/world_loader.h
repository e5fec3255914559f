#pragma once

#include <span>
#include <string>
#include <vector>

#include "common/config/scene_config.h"
#include "runtime/scene/scene_loader.h"
#include "runtime/sim/world/world.h"

namespace exmat::runtime {

/// Bodies of one kind, ready to step.
struct LoadedKind {
  LoadedScene loaded;
  std::shared_ptr<const TouchingSurface> surface;
};

/// A body of a loaded world.
struct LoadedBody {
  std::string name;      ///< of its kind, with its number where there are several: teddy_12
  std::size_t kind = 0;  ///< in LoadedWorld::kinds
  State start;
};

/// A scene of several bodies, ready to step.
struct LoadedWorld {
  std::vector<LoadedKind> kinds;
  std::vector<LoadedBody> bodies;
};

/// Reads the bundles. Throws InputError as load_run, and where bodies that do not move freely are to be in several
/// places.
LoadedWorld load_world_run(const WorldConfig& config);

/// The surface of bodies of a model, of what /object and /modal of its bundle hold.
std::shared_ptr<const TouchingSurface> touching_surface(const Model& model, const ReducedModel& data,
                                                        bool meets_itself);

/// Its bodies as they start; refers to `loaded`, and to `scenes` of its kinds in place of those that it holds.
World make_world(const LoadedWorld& loaded, const WorldConfig& config, std::span<const StepScene> scenes = {});

}  // namespace exmat::runtime
