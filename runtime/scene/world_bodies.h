#pragma once

#include <cstdint>
#include <vector>

#include "common/config/scene_config.h"
#include "runtime/scene/world_loader.h"

namespace exmat::runtime {

/// All that the bodies of a world carry from step to step.
struct WorldMemory {
  std::vector<State> states;
  std::vector<HeldPair> held;
  std::vector<bool> anew;  ///< World::is_anew()
};

/// The bodies of a loaded scene of several as they are stepped.
class WorldBodies {
 public:
  /// Refers to both as long as it lives. As many threads as OpenMP gives, at most one for each processor.
  WorldBodies(const LoadedWorld& loaded, const WorldConfig& config);
  WorldBodies(const WorldBodies&) = delete;
  WorldBodies& operator=(const WorldBodies&) = delete;

  const World& world() const { return world_; }
  const LoadedWorld& loaded() const { return loaded_; }
  int count() const { return world_.count(); }
  int threads() const { return threads_; }
  /// Steps taken, the same for all.
  std::int64_t steps() const { return world_.state(0).step; }

  /// One step of all bodies.
  WorldReport step();
  /// All back to the start.
  void restart() { take_up(start_); }

  void remember(WorldMemory& memory) const;
  /// Of a world of the same bodies.
  void take_up(const WorldMemory& memory);

  /// WorkError where the last step was not finite: names step, time, body and what to try.
  void require_finite() const;
  bool is_finite() const;

  /// FNV-1a over all bodies, in order, by add_to_hash().
  std::uint64_t hash() const;

  void set_profile(WorldProfile* profile) { world_.set_profile(profile); }

 private:
  const LoadedWorld& loaded_;
  const WorldConfig& config_;
  std::vector<StepScene> scenes_;  // of the kinds, as their keys change them; the world refers to them
  World world_;
  int threads_;
  WorldMemory start_;
};

}  // namespace exmat::runtime
