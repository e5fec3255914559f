#pragma once

#include <array>
#include <chrono>
#include <string_view>

namespace exmat::runtime {

enum class Stage { kWeights, kTarget, kInternalForce, kSolve, kContact, kOutput };

inline constexpr std::array<std::string_view, 6> kStageNames{"weights", "target",  "internal_force",
                                                             "solve",   "contact", "output"};

/// Time and floating-point operations of each stage; adds up until the caller sets it to zero.
struct Profile {
  std::array<double, kStageNames.size()> seconds{};
  std::array<double, kStageNames.size()> flops{};
};

/// Adds the time of its own life and `flops` to one stage; without a profile it does not look at the clock.
class StageTimer {
 public:
  StageTimer(Profile* profile, Stage stage, double flops = 0) noexcept : profile_(profile), stage_(stage) {
    if (profile_ == nullptr) return;
    profile_->flops[static_cast<std::size_t>(stage_)] += flops;
    start_ = Clock::now();
  }
  ~StageTimer() {
    if (profile_ == nullptr) return;
    profile_->seconds[static_cast<std::size_t>(stage_)] += std::chrono::duration<double>(Clock::now() - start_).count();
  }
  StageTimer(const StageTimer&) = delete;
  StageTimer& operator=(const StageTimer&) = delete;

 private:
  using Clock = std::chrono::steady_clock;
  Profile* profile_;
  Stage stage_;
  Clock::time_point start_;
};

}  // namespace exmat::runtime
