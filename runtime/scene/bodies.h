#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "runtime/scene/state_hash.h"
#include "runtime/scene/world_loader.h"
#include "runtime/sim/world/world.h"

namespace exmat::runtime {

/// All that the bodies of a scene carry from step to step.
struct BodiesMemory {
  std::vector<State> states;
  std::vector<HeldPair> held;
};

/// The bodies of a loaded scene as they are stepped.
class Bodies {
 public:
  /// Refers to both as long as it lives. As many threads as OpenMP gives, at most one for each body.
  Bodies(const LoadedWorld& loaded, const WorldConfig& config);
  Bodies(const Bodies&) = delete;
  Bodies& operator=(const Bodies&) = delete;

  World& world() { return world_; }
  const World& world() const { return world_; }
  const LoadedWorld& loaded() const { return loaded_; }
  const WorldConfig& config() const { return config_; }
  int count() const { return world_.count(); }
  int threads() const { return threads_; }
  /// Steps taken, the same for all.
  std::int64_t steps() const { return world_.state(0).step; }

  /// One step of all bodies.
  WorldReport step(StepObserver* observer = nullptr);
  /// All back to the start.
  void restart();

  void remember(BodiesMemory& memory) const;
  /// Takes up the memory of the same bodies.
  void take_up(BodiesMemory memory);

  /// Distance from its place of the point that is farthest from it, of bodies that reach in their modes [m].
  std::optional<double> farthest_reach() const;

  bool is_finite() const;
  /// WorkError where the last step was not finite: names step, time, body and what to try.
  void require_finite() const;

  /// FNV-1a over all bodies, in order, by add_to_hash().
  std::uint64_t hash() const;

 private:
  /// A body that chooses its weights has a scene of its own.
  struct Reaching {
    const LoadedScene& kind;
    StepScene scene;
    std::unique_ptr<Reach> reach;
  };
  std::vector<std::unique_ptr<Reaching>> reaching_at_start() const;
  std::vector<WorldBodyStart> starts() const;

  const LoadedWorld& loaded_;
  const WorldConfig& config_;
  std::vector<StepScene> scenes_;  // of the kinds, as their keys change them; the world refers to them
  std::vector<std::unique_ptr<Reaching>> reaching_;  // of each body; null: it does not. The world refers to them
  World world_;
  int threads_;
};

}  // namespace exmat::runtime
