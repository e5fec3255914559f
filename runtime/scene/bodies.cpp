#include "runtime/scene/bodies.h"

#include <algorithm>
#include <fmt/format.h>
#include <omp.h>
#include <utility>

#include "common/core/error.h"
#include "runtime/scene/reach_loader.h"

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

constexpr double kShortStep = 1e-9;  // [s], below which motion is lost in the digits of places

bool is_bad(const World& world, int body) { return (world.report(body).status & kStepNonFinite) != 0; }

}  // namespace

Bodies::Bodies(const LoadedWorld& loaded, const WorldConfig& config)
    : loaded_(loaded),
      config_(config),
      scenes_(scenes_at_start(loaded)),
      reaching_(reaching_at_start()),
      world_(starts(),
             {config.contact.stiffness, config.contact.damping, config.contact.friction, config.contact.release}),
      threads_(std::min(omp_get_max_threads(), world_.count())) {
  world_.set_full_bodies(config.full_bodies);
  for (int i = 0; i < count(); ++i) {
    Reaching* const own = reaching_[static_cast<std::size_t>(i)].get();
    if (own == nullptr) continue;
    own->reach = std::make_unique<Reach>(*own->kind.model, own->scene, world_.state(i), own->kind.reach->targets);
  }
}

std::vector<std::unique_ptr<Bodies::Reaching>> Bodies::reaching_at_start() const {
  std::vector<std::unique_ptr<Reaching>> reaching;
  for (const LoadedBody& body : loaded_.bodies) {
    const LoadedScene& kind = loaded_.kinds[body.kind].loaded;
    reaching.push_back(kind.reach ? std::make_unique<Reaching>(kind, scenes_[body.kind]) : nullptr);
  }
  return reaching;
}

std::vector<WorldBodyStart> Bodies::starts() const {
  std::vector<std::vector<ExampleState>> examples;
  for (std::size_t i = 0; i < loaded_.kinds.size(); ++i) {
    const LoadedScene& kind = loaded_.kinds[i].loaded;
    State state = kind.start;
    Workspace workspace(*kind.model, scenes_[i]);
    refresh_weights(*kind.model, scenes_[i], state, workspace);
    examples.push_back(std::move(state.examples));
  }
  std::vector<State> states = starts_of(loaded_);
  std::vector<WorldBodyStart> bodies;
  bodies.reserve(loaded_.bodies.size());
  for (const LoadedBody& body : loaded_.bodies) {
    const LoadedKind& kind = loaded_.kinds[body.kind];
    State& state = states[bodies.size()];
    state.examples = examples[body.kind];
    if (kind.loaded.full) put_by_shifts(*kind.loaded.full, scenes_[body.kind], state);
    const Reaching* const own = reaching_[bodies.size()].get();
    bodies.push_back({{kind.loaded.model.get(), own != nullptr ? &own->scene : &scenes_[body.kind], kind.surface,
                       kind.loaded.full.get()},
                      std::move(state)});
  }
  return bodies;
}

void Bodies::restart() {
  BodiesMemory memory;
  for (WorldBodyStart& start : starts()) memory.states.push_back(std::move(start.state));
  take_up(std::move(memory));
}

WorldReport Bodies::step(StepObserver* observer) {
  for (std::size_t i = 0; i < scenes_.size(); ++i) {
    const LoadedScene& kind = loaded_.kinds[i].loaded;
    kind.keys.apply(*kind.model, steps(), scenes_[i]);
  }
  for (int i = 0; i < count(); ++i) {
    Reaching* const own = reaching_[static_cast<std::size_t>(i)].get();
    if (own == nullptr) continue;
    own->kind.keys.apply(*own->kind.model, steps(), own->scene);
    move_targets(*own->kind.reach, own->scene, world_.state(i), *own->reach);
    own->reach->choose_weights(own->scene);
  }
  return world_.step(threads_, observer);
}

void Bodies::remember(BodiesMemory& memory) const {
  memory.states.resize(static_cast<std::size_t>(count()));
  for (int i = 0; i < count(); ++i) memory.states[static_cast<std::size_t>(i)] = world_.state(i);
  memory.held = world_.held();
}

void Bodies::take_up(BodiesMemory memory) {
  for (int i = 0; i < count(); ++i) world_.state(i) = std::move(memory.states[static_cast<std::size_t>(i)]);
  world_.set_memory(std::move(memory.held));
}

std::optional<double> Bodies::farthest_reach() const {
  std::optional<double> most;
  for (int i = 0; i < count(); ++i) {
    const Reaching* const own = reaching_[static_cast<std::size_t>(i)].get();
    if (own == nullptr || world_.state(i).full) continue;
    most = std::max(most.value_or(0), farthest(world_.model(i), world_.state(i), own->reach->targets()));
  }
  return most;
}

bool Bodies::is_finite() const {
  for (int i = 0; i < count(); ++i)
    if (is_bad(world_, i)) return false;
  return true;
}

void Bodies::require_finite() const {
  for (int i = 0; i < count(); ++i) {
    if (!is_bad(world_, i)) continue;
    const State& state = world_.state(i);
    const std::string& name = loaded_.bodies[static_cast<std::size_t>(i)].name;
    throw WorkError(fmt::format(
        "{}: step {} (t = {:g} s), body {}: the state is no longer finite; try a {} time_step (now {:g} s), "
        "smaller loads, contact or example stiffness, or the integrator backward_euler. No trajectory was written",
        config_.file.string(), state.step + 1, state.time + config_.time_step,
        name.empty() ? fmt::format("{} of {}", i + 1, count()) : name,
        config_.time_step < kShortStep ? "larger" : "smaller", config_.time_step));
  }
}

std::uint64_t Bodies::hash() const {
  FnvHash hash;
  for (int i = 0; i < count(); ++i) add_to_hash(world_.model(i), world_.state(i), hash);
  return hash.value();
}

}  // namespace exmat::runtime
