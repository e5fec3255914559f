#pragma once

#include "common/config/scene_config.h"
#include "runtime/scene/bodies.h"

namespace exmat::precompute {

/// The bodies of a scene, ready to step: the one place where the study of stability meets runtime/scene.
class SceneBodies {
 public:
  /// Reads the bundles; of a scene that names one it takes one body. Not thread-safe. Throws InputError as
  /// load_world_run(), and where a bundle lacks the mesh or the basis of all vertices.
  explicit SceneBodies(WorldConfig scene);
  SceneBodies(const SceneBodies&) = delete;
  SceneBodies& operator=(const SceneBodies&) = delete;

  int count() const { return bodies_.count(); }
  std::size_t kind_of(int body) const { return loaded_.bodies[static_cast<std::size_t>(body)].kind; }
  std::size_t kinds() const { return loaded_.kinds.size(); }
  const runtime::LoadedScene& kind(std::size_t kind) const { return loaded_.kinds[kind].loaded; }
  const runtime::State& state(int body) const { return bodies_.world().state(body); }
  runtime::Energies energies() const { return bodies_.world().energies(); }

  struct Step {
    int non_finite = 0;     ///< bodies whose state is not finite
    bool unsolved = false;  ///< a residual is above its tolerance
  };
  Step step();

 private:
  WorldConfig scene_;
  runtime::LoadedWorld loaded_;
  runtime::Bodies bodies_;
};

}  // namespace exmat::precompute
