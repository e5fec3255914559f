#include "precompute/study/stability/scene_bodies.h"

#include <utility>

#include "common/config/config.h"
#include "runtime/scene/scene_run.h"

namespace exmat::precompute {
namespace {

constexpr unsigned kUnsolved = runtime::kStepIterationLimit | runtime::kStepStagnated;

}  // namespace

AnyScene load_any_scene(const std::filesystem::path& file) {
  if (std::optional<WorldConfig> world = load_world(file)) return std::move(*world);
  return load_scene(file);
}

std::vector<SceneConfig*> kinds_of(AnyScene& scene) {
  if (auto* one = std::get_if<SceneConfig>(&scene)) return {one};
  std::vector<SceneConfig*> kinds;
  for (BodiesConfig& bodies : std::get<WorldConfig>(scene).bodies) kinds.push_back(&bodies.scene);
  return kinds;
}

SceneBodies::SceneBodies(AnyScene scene) : scene_(std::move(scene)) {
  if (auto* config = std::get_if<WorldConfig>(&scene_)) {
    several_ = std::make_unique<runtime::LoadedWorld>(runtime::load_world_run(*config));
    world_ = std::make_unique<runtime::WorldBodies>(*several_, *config);
    return;
  }
  auto& config = std::get<SceneConfig>(scene_);
  config.instances = 1;
  config.render = false;
  config.trajectory = "none";  // a scene with a trajectory reads the mesh and the basis of all vertices
  one_ = std::make_unique<runtime::LoadedScene>(runtime::load_run(config));
  body_ = std::make_unique<runtime::Bodies>(runtime::make_bodies(*one_, config));
}

const runtime::State& SceneBodies::state(int body) const { return world_ ? world_->world().state(body) : (*body_)[0]; }

runtime::Energies SceneBodies::energies() const {
  return world_ ? world_->world().energies() : runtime::energies(*one_->model, body_->scene(), (*body_)[0]);
}

SceneBodies::Step SceneBodies::step() {
  Step done;
  const auto add = [&](unsigned status) {
    done.non_finite += (status & runtime::kStepNonFinite) != 0 ? 1 : 0;
    done.unsolved |= (status & kUnsolved) != 0;
  };
  if (!world_) {
    add(body_->step()[0].status);
    return done;
  }
  done.unsolved = world_->step().unconverged_islands > 0;
  for (int i = 0; i < count(); ++i) add(world_->world().report(i).status);
  return done;
}

}  // namespace exmat::precompute
