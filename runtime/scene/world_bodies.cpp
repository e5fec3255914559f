#include "runtime/scene/world_bodies.h"

#include <algorithm>
#include <fmt/format.h>
#include <omp.h>

#include "common/core/error.h"
#include "common/core/fnv_hash.h"
#include "runtime/scene/bodies.h"

namespace exmat::runtime {
namespace {

std::vector<StepScene> scenes_at_start(const LoadedWorld& loaded) {
  std::vector<StepScene> scenes;
  for (const LoadedKind& kind : loaded.kinds) {
    scenes.push_back(kind.loaded.scene);
    kind.loaded.keys.apply_start(*kind.loaded.model, scenes.back());
  }
  return scenes;
}

bool is_bad(const World& world, int body) { return (world.report(body).status & kStepNonFinite) != 0; }

}  // namespace

WorldBodies::WorldBodies(const LoadedWorld& loaded, const WorldConfig& config)
    : loaded_(loaded),
      config_(config),
      scenes_(scenes_at_start(loaded)),
      world_(make_world(loaded, config, scenes_)),
      threads_(std::min(omp_get_max_threads(), omp_get_num_procs())) {
  remember(start_);
}

WorldReport WorldBodies::step() {
  for (std::size_t i = 0; i < scenes_.size(); ++i) {
    const LoadedScene& kind = loaded_.kinds[i].loaded;
    kind.keys.apply(*kind.model, steps(), scenes_[i]);
  }
  return world_.step(threads_);
}

void WorldBodies::remember(WorldMemory& memory) const {
  const auto bodies = static_cast<std::size_t>(count());
  memory.states.resize(bodies);
  memory.anew.resize(bodies);
  for (std::size_t i = 0; i < bodies; ++i) {
    memory.states[i] = world_.state(static_cast<int>(i));
    memory.anew[i] = world_.is_anew(static_cast<int>(i));
  }
  memory.held = world_.held();
}

void WorldBodies::take_up(const WorldMemory& memory) {
  for (int i = 0; i < count(); ++i) world_.state(i) = memory.states[static_cast<std::size_t>(i)];
  world_.set_memory(memory.held, memory.anew);
}

bool WorldBodies::is_finite() const {
  for (int i = 0; i < count(); ++i)
    if (is_bad(world_, i)) return false;
  return true;
}

void WorldBodies::require_finite() const {
  for (int i = 0; i < count(); ++i) {
    if (!is_bad(world_, i)) continue;
    const State& state = world_.state(i);
    throw WorkError(
        fmt::format("{}: step {} (t = {:g} s), body {}: the state is no longer finite; try a smaller time_step (now "
                    "{:g} s), smaller "
                    "loads, contact or example stiffness. No trajectory was written",
                    config_.file.string(), state.step + 1, state.time + config_.time_step,
                    loaded_.bodies[static_cast<std::size_t>(i)].name, config_.time_step));
  }
}

std::uint64_t WorldBodies::hash() const {
  FnvHash hash;
  for (int i = 0; i < count(); ++i) add_to_hash(world_.model(i), world_.state(i), hash);
  return hash.value();
}

}  // namespace exmat::runtime
