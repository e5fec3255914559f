#pragma once

#include <memory>
#include <mutex>
#include <new>
#include <vector>

#include "runtime/sim/lanes/lane_step.h"

namespace exmat::runtime {

/// Scratch for bodies of one model and scene that step side by side, lent to a thread at a time and kept for later
/// calls: as many as threads have asked at once. Safe to use from any thread.
class LanePool {
 public:
  /// Null for want of memory. To be given back.
  std::unique_ptr<LaneWorkspace> take(const Model& model, const StepScene& scene) noexcept {
    {
      const std::scoped_lock lock(mutex_);
      if (!free_.empty()) {
        auto taken = std::move(free_.back());
        free_.pop_back();
        return taken;
      }
    }
    try {
      return std::make_unique<LaneWorkspace>(model, scene);
    } catch (const std::bad_alloc&) {
      return nullptr;
    }
  }

  void give_back(std::unique_ptr<LaneWorkspace> workspace) noexcept {
    if (!workspace) return;
    const std::scoped_lock lock(mutex_);
    try {
      free_.push_back(std::move(workspace));
    } catch (const std::bad_alloc&) {
    }
  }

 private:
  std::mutex mutex_;
  std::vector<std::unique_ptr<LaneWorkspace>> free_;
};

}  // namespace exmat::runtime
