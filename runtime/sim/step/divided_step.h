#pragma once

#include <optional>

#include "runtime/sim/solver/newton.h"
#include "runtime/sim/step/scene.h"
#include "runtime/sim/step/state.h"
#include "runtime/sim/step/step_report.h"

namespace exmat::runtime {

/// True if a step of such settings has no solution in one: rounding did not end the search near one, and the scene
/// bounds the iterations no more than by default, which would say that time is short.
bool has_no_solution(const NewtonReport& newton, const NewtonSettings& settings) noexcept;

/// A step of a body in several smaller ones, its parts: keeps what it was where the step begins. Allocates.
/// docs/step_in_detail.md, "Steps without a solution".
class DividedStep {
 public:
  /// The step has not changed the body yet, and the body does not hang on bones.
  DividedStep(const StepScene& scene, State& state) : whole_(scene), state_(state), start_(state) {}

  /// Puts the body back to the start of the step, which has so many parts; in one it is whole again.
  void begin(int parts);
  /// Returns the scene of the parts, or that of the whole step where there is one part.
  const StepScene& scene() const noexcept { return part_ ? *part_ : whole_; }

  /// Moves frames of a host evenly through the step; called before each part.
  void begin_part(int part) noexcept;
  /// Adds the report of a part, after it.
  void end_part(const StepReport& report) noexcept;

  /// Makes the body that of one step, after all parts, and returns the report of all.
  StepReport end() noexcept;

 private:
  const StepScene& whole_;
  State& state_;
  State start_;
  std::optional<StepScene> part_;
  StepReport sum_;
  int parts_ = 1;
};

/// A step is tried in the fewest parts, then in so many times as many, up to the most.
inline constexpr int kFewestStepParts = 4, kMostStepParts = 16;

/// Calls begin(parts), then take(part) of each, which returns its StepStatus: in as few parts as have solutions, in the
/// most where none have. False after begin(1) where numbers do not stay finite in these.
template <class Begin, class Take>
bool take_in_parts(const Begin& begin, const Take& take) {
  for (int parts = kFewestStepParts; parts <= kMostStepParts; parts *= kFewestStepParts) {
    begin(parts);
    std::uint32_t status = 0;
    for (int part = 0; part < parts && (status & kStepNonFinite) == 0; ++part) status |= take(part);
    if ((status & kStepNonFinite) != 0) continue;
    if ((status & kStepUnconverged) == 0 || parts == kMostStepParts) return true;
  }
  begin(1);
  return false;
}

}  // namespace exmat::runtime
