#pragma once

#include <memory>
#include <variant>

#include "common/config/scene_config.h"
#include "runtime/scene/bodies.h"
#include "runtime/scene/world_bodies.h"

namespace exmat::precompute {

/// A scene of one body or of several.
using AnyScene = std::variant<SceneConfig, WorldConfig>;

/// Reads a scene file. Throws InputError.
AnyScene load_any_scene(const std::filesystem::path& file);

/// The scenes of its kinds of bodies: of one body itself.
std::vector<SceneConfig*> kinds_of(AnyScene& scene);

/// The bodies of a scene, ready to step: the one place where the study of stability meets runtime/scene.
class SceneBodies {
 public:
  /// Reads the bundles. Not thread-safe. Throws InputError as load_run(), and where a bundle lacks the mesh or the
  /// basis of all vertices.
  explicit SceneBodies(AnyScene scene);

  int count() const { return world_ ? world_->count() : 1; }
  std::size_t kind_of(int body) const { return several_ ? several_->bodies[static_cast<std::size_t>(body)].kind : 0; }
  std::size_t kinds() const { return several_ ? several_->kinds.size() : 1; }
  const runtime::LoadedScene& kind(std::size_t kind) const { return one_ ? *one_ : several_->kinds[kind].loaded; }
  const runtime::State& state(int body) const;
  runtime::Energies energies() const;

  struct Step {
    int non_finite = 0;     ///< bodies whose state is not finite
    bool unsolved = false;  ///< a residual is above its tolerance
  };
  Step step();

 private:
  AnyScene scene_;
  std::unique_ptr<runtime::LoadedScene> one_;
  std::unique_ptr<runtime::Bodies> body_;
  std::unique_ptr<runtime::LoadedWorld> several_;
  std::unique_ptr<runtime::WorldBodies> world_;
};

}  // namespace exmat::precompute
