#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "common/core/fnv_hash.h"
#include "runtime/scene/step_work.h"
#include "runtime/sim/lanes/lane_step.h"
#include "runtime/sim/step/scene_keys.h"
#include "runtime/sim/step/stepper.h"

namespace exmat::runtime {

/// Adds the bits of q and v of a body, of a free one also where it is and its momenta.
void add_to_hash(const Model& model, const State& state, FnvHash& hash);

/// N bodies of one model in one scene, stepped together from the same start: kLanes at a time side by side where that
/// can be. OpenMP over these groups in fixed shares, scratch for each thread: no body depends on another, nor on the
/// number of threads.
class Bodies {
 public:
  /// Refers to the model as long as it lives; count >= 1. The keys change the scene in time. As many threads as OpenMP
  /// gives, at most one for each body.
  Bodies(const Model& model, StepScene scene, State start, int count, SceneKeys keys = {});

  int count() const { return static_cast<int>(states_.size()); }
  int threads() const { return static_cast<int>(threads_.size()); }
  /// As the last step read it.
  const StepScene& scene() const { return scene_; }
  State& operator[](int body) { return states_[static_cast<std::size_t>(body)]; }
  const State& operator[](int body) const { return states_[static_cast<std::size_t>(body)]; }

  /// All back to the start.
  void restart();

  /// One step of each body, without allocation. Reports in the order of the bodies.
  std::span<const StepReport> step() noexcept;

  /// The first body that the last step left because of a number that is not finite.
  std::optional<int> first_non_finite() const;

  /// Of a single body: what obstacles pressed it by in the last step, as add_contact_load().
  void add_contact_load(Eigen::VectorXd& load) const;

  /// FNV-1a over all bodies, in order, by add_to_hash().
  std::uint64_t hash() const;

  /// Lets steps measure their stages and count their work.
  void set_profiled(bool profiled);

  struct Measured {
    double seconds = 0;  ///< of whole steps
    Profile profile;
    StepWork work;
  };
  /// Of all steps of all bodies since the last call.
  Measured take_measured();

 private:
  struct alignas(128) Thread {  // no cache line of two threads
    LaneWorkspace workspace;
    Measured measured;
  };
  void step_share(int thread) noexcept;
  void step_share_awake(int thread) noexcept;
  void step_awake(std::span<const std::size_t> awake, Thread& thread) noexcept;
  void step_group(std::size_t first, std::size_t last, std::size_t end_of_share, Thread& thread) noexcept;

  const Model& model_;
  StepScene scene_;
  SceneKeys keys_;
  State start_;
  std::vector<State> states_;
  std::vector<StepReport> reports_;
  std::vector<Thread> threads_;
  bool side_by_side_ = false;  ///< in this step
};

}  // namespace exmat::runtime
