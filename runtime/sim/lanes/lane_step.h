#pragma once

#include <span>

#include "runtime/sim/lanes/lane_workspace.h"
#include "runtime/sim/step/state.h"
#include "runtime/sim/step/step_report.h"

namespace exmat::runtime {

/// A body that steps side by side with others, referred to.
struct LaneBody {
  const StepScene* scene;
  State* state;
  Workspace* workspace = nullptr;  ///< its own scratch; null: that of its lane
};

/// One step of each of 1 to kLanes bodies of one model, as step() takes it, but side by side: each in its lane of the
/// registers, so that the model's constants are read once for all. docs/step_in_detail.md, "Bodies in lanes". A body
/// that sleeps, and one that Newton's method needs more for than whole steps with exact Hessians, step by themselves.
/// No body's numbers depend on the others'; they are those of step() to rounding. No call allocates or throws. `next`:
/// those whose turn comes after these, if that is known.
void step_in_lanes(const Model& model, std::span<const LaneBody> bodies, LaneWorkspace& workspace,
                   std::span<StepReport> reports, std::span<const LaneBody> next = {}) noexcept;

}  // namespace exmat::runtime
