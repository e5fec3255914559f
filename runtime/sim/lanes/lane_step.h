#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "runtime/sim/lanes/lane_examples.h"
#include "runtime/sim/lanes/lane_forms.h"
#include "runtime/sim/lanes/lane_frames.h"
#include "runtime/sim/lanes/lane_numbers.h"
#include "runtime/sim/step/scene.h"
#include "runtime/sim/step/state.h"
#include "runtime/sim/step/step_report.h"
#include "runtime/sim/step/workspace.h"

namespace exmat::runtime {

/// Fewer bodies than these are faster one after the other.
inline constexpr std::ptrdiff_t kFewestLanes = 4;

/// Whether steps of this model in this scene can be taken side by side: elasticity by cubature, linear example forces
/// of a symmetric filter.
bool can_step_side_by_side(const Model& model, const StepScene& scene) noexcept;

/// One of them, referred to.
struct LaneBody {
  const StepScene* scene;
  State* state;
};

/// Scratch of bodies of one model, sized once. One per thread.
class LaneWorkspace {
 public:
  /// Of groups of up to `bodies` in [1, kLanes].
  LaneWorkspace(const Model& model, const StepScene& scene, std::size_t bodies = kLanes);

  /// What a body's step left, as Workspace of step().
  Workspace& body(std::size_t lane) { return bodies_[lane]; }
  const Workspace& body(std::size_t lane) const { return bodies_[lane]; }

  /// Stages of all lanes add to it; null: nobody times them.
  void set_profile(Profile* profile);

 private:
  friend class LaneStep;
  std::vector<Workspace> bodies_;
  LaneForms forms_;
  AlignedArray q_, previous_, trial_, gradient_, trial_gradient_, internal_, direction_, linear_, frozen_, next_frozen_,
      offset_;                                                // r x kLanes
  AlignedArray quadratic_, stiffness_, factor_, new_factor_;  // lane_triangle(r)
  std::vector<LaneExamples> examples_;                        // one for each of the model's
  LaneFrames frames_;
  bool predictor_was_lower_ = true;  ///< in the last step, of all; see Workspace
};

/// One step of each of 1 to kLanes bodies of one model, as step() takes it, but side by side: each in its lane of the
/// registers, so that the model's constants are read once for all. docs/step_in_detail.md, "Bodies in lanes". A body
/// that sleeps, one near an obstacle, and one that Newton's method needs more for than whole steps with exact Hessians,
/// step by themselves. No body's numbers depend on the others'; they are those of step() to rounding. No call allocates
/// or throws. `next`: those whose turn comes after these, if that is known.
void step_in_lanes(const Model& model, std::span<const LaneBody> bodies, LaneWorkspace& workspace,
                   std::span<StepReport> reports, std::span<const LaneBody> next = {}) noexcept;

/// The same, but that those of a group of fewer than kFewestLanes step by themselves.
void step_side_by_side(const Model& model, std::span<const LaneBody> bodies, LaneWorkspace& workspace,
                       std::span<StepReport> reports, std::span<const LaneBody> next = {}) noexcept;

}  // namespace exmat::runtime
