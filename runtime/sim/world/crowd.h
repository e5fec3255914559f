#pragma once

#include <array>
#include <optional>
#include <vector>

#include "runtime/sim/lanes/lane_step.h"
#include "runtime/sim/solver/profile.h"
#include "runtime/sim/space/full/full_step.h"

namespace exmat::runtime {

/// Sees each body of a World that is awake right after its step, on the thread that took it.
class StepObserver {
 public:
  /// `scratch` holds the contacts of the step.
  virtual void after_step(int body, const StepReport& report, const Workspace& scratch) noexcept = 0;

 protected:
  ~StepObserver() = default;
};

/// The bodies of a World that touch no other body in a step: those of one model take it kLanes at a time side by side,
/// the rest one by one, shared by the threads. It owns their scratch. A body's numbers depend on no other body and not
/// on the number of threads: whether it goes side by side depends on its place among those of its model alone.
class Crowd {
 public:
  /// A body that takes this step.
  struct Body {
    int number = 0;  ///< in the world
    int kind = 0;
    const StepScene* scene = nullptr;
    State* state = nullptr;
    Workspace* workspace = nullptr;  ///< its own scratch; null: one of the crowd's
    StepReport* report = nullptr;
    const FullModel* full = nullptr;  ///< it steps in full space
    FullWorkspace* full_workspace = nullptr;
    bool goes_alone = false;  ///< not side by side with others: in full space, or held by a host
  };

  /// One more body of this model; its kind. Sizes scratch.
  int add(const Model& model, const StepScene& scene);
  void remove(int kind);
  /// Its scene has other obstacles than before.
  void fit(int kind, const StepScene& scene);
  /// That of the first thread, between steps.
  Workspace& scratch(int kind) noexcept { return threads_.front().of_kind[static_cast<std::size_t>(kind)]->body(0); }
  /// Scratch for so many threads.
  void prepare(int threads);

  // One step: begin(), count() of all bodies that do not go alone, then take() or leave() of each in the same order,
  // take() of those that do, step().

  void begin() noexcept;
  void count(int kind, const StepScene& scene) noexcept;
  void take(const Body& body);
  /// A body that does not step here.
  void leave(int kind, const StepScene& scene) noexcept;
  void step(int most_threads, StepObserver* observer, WorldProfile* profile) noexcept;

 private:
  struct Kind {
    const Model* model = nullptr;  ///< null: its last body was removed
    StepScene scene;               ///< that scratch is sized for: the one of most obstacles
    int bodies = 0;
    // One step: bodies able to go side by side, those of them seen, and the group that is not full, or -1.
    int able = 0, seen = 0, open = -1;

    /// Those of a last group that is too small for lanes step by themselves.
    int in_lanes() const noexcept {
      const int rest = able % static_cast<int>(kLanes);
      return able - (rest < static_cast<int>(kFewestLanes) ? rest : 0);
    }
  };
  struct Group {
    int kind = 0;
    bool in_lanes = false;
    std::array<int, kLanes> bodies{};  ///< in bodies_
    std::size_t count = 0;
  };
  struct alignas(128) Thread {                          // no cache line of two threads
    std::vector<std::optional<LaneWorkspace>> of_kind;  ///< none of a kind without bodies
    Profile profile;
    double seconds = 0;
  };

  static bool goes_in_lanes(const Kind& kind) noexcept;
  int useful(int threads) const noexcept;
  void size(Thread& thread) const;
  bool is_in_lanes(int kind, const StepScene& scene) noexcept;
  void step_group(const Group& group, const Group* next, Thread& thread, StepObserver* observer,
                  bool profiled) noexcept;

  void step_lanes(const Group& group, const Group* next, LaneWorkspace& scratch) noexcept;

  std::vector<Kind> kinds_;
  std::vector<Thread> threads_;
  std::vector<Body> bodies_;
  std::vector<Group> groups_;
};

}  // namespace exmat::runtime
