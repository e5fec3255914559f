#pragma once

#include <array>
#include <chrono>
#include <string_view>

namespace exmat::runtime {

enum class Stage { kWeights, kTarget, kInternalForce, kSolve, kContact, kOutput };

inline constexpr std::array<std::string_view, 6> kStageNames{"weights", "target",  "internal_force",
                                                             "solve",   "contact", "output"};

/// Stages of a step of a World; other: the rest of it.
enum class WorldStage { kBroadPhase, kCandidates, kSingleBodies, kIslands, kOther };

inline constexpr std::array<std::string_view, 5> kWorldStageNames{"broad_phase", "candidates", "single_bodies",
                                                                  "islands", "other"};

/// Time and floating-point operations of each stage; adds up until the caller sets it to zero.
template <typename StageOf, std::size_t kCount>
struct StageProfile {
  using Stages = StageOf;
  std::array<double, kCount> seconds{};
  std::array<double, kCount> flops{};
};
using Profile = StageProfile<Stage, kStageNames.size()>;
/// The stages on the wall clock; and those of the steps of single bodies, as the threads' clocks add up.
struct WorldProfile : StageProfile<WorldStage, kWorldStageNames.size()> {
  Profile bodies;
  double bodies_seconds = 0;  ///< time of their whole steps
};

/// Adds the time of its own life and `flops` to one stage; without a profile it does not look at the clock.
template <typename AnyProfile>
class StageTimer {
 public:
  StageTimer(AnyProfile* profile, typename AnyProfile::Stages stage, double flops = 0) noexcept
      : profile_(profile), stage_(stage) {
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
  AnyProfile* profile_;
  typename AnyProfile::Stages stage_;
  Clock::time_point start_;
};

}  // namespace exmat::runtime
