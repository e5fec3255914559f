#include "precompute/study/stability/scene_bodies.h"

#include <utility>

#include "common/config/config.h"

namespace exmat::precompute {
namespace {

WorldConfig to_study(WorldConfig scene) {
  if (scene.is_list) return scene;
  for (BodiesConfig& kind : scene.bodies) {
    kind.places.resize(1);
    kind.scene.render = false;
  }
  set_trajectory("none", scene);  // a scene with a trajectory reads the mesh and the basis of all vertices
  return scene;
}

}  // namespace

SceneBodies::SceneBodies(WorldConfig scene)
    : scene_(to_study(std::move(scene))), loaded_(runtime::load_world_run(scene_)), bodies_(loaded_, scene_) {}

SceneBodies::Step SceneBodies::step() {
  Step done{.unsolved = bodies_.step().unconverged_islands > 0};
  for (int i = 0; i < count(); ++i) {
    const unsigned status = bodies_.world().report(i).status;
    done.non_finite += (status & runtime::kStepNonFinite) != 0 ? 1 : 0;
    done.unsolved |= (status & (runtime::kStepIterationLimit | runtime::kStepStagnated)) != 0;
  }
  return done;
}

}  // namespace exmat::precompute
