#pragma once

#include <Eigen/Core>
#include <vector>

#include "runtime/sim/lanes/lane_examples.h"
#include "runtime/sim/lanes/lane_forms.h"
#include "runtime/sim/lanes/lane_frames.h"
#include "runtime/sim/step/scene.h"
#include "runtime/sim/step/workspace.h"

namespace exmat::runtime {

/// Fewer bodies than these are faster one after the other.
inline constexpr std::ptrdiff_t kFewestLanes = 4;

/// True if steps of this model in this scene can be taken side by side: elasticity by cubature, linear example forces
/// of a symmetric filter.
bool can_step_side_by_side(const Model& model, const StepScene& scene) noexcept;

/// Scratch of bodies of one model, sized once. One per thread.
class LaneWorkspace {
 public:
  /// Memory for groups of up to `bodies` in [1, kLanes].
  LaneWorkspace(const Model& model, const StepScene& scene, std::size_t bodies = kLanes);

  /// Scratch of a lane whose body has none of its own: what its step left, as Workspace of step().
  Workspace& body(std::size_t lane) { return bodies_[lane]; }
  const Workspace& body(std::size_t lane) const { return bodies_[lane]; }
  std::size_t bodies() const { return bodies_.size(); }

  /// Stages of all lanes add to it; null: nobody times them.
  void set_profile(Profile* profile);

 private:
  friend class LaneStep;
  std::vector<Workspace> bodies_;
  LaneForms forms_;
  AlignedArray q_, previous_, trial_, gradient_, trial_gradient_, internal_, direction_, linear_, frozen_, next_frozen_,
      offset_, elastic_scratch_;                              // r x kLanes
  AlignedArray quadratic_, stiffness_, factor_, new_factor_;  // lane_triangle(r)
  std::vector<LaneExamples> examples_;                        // one for each of the model's
  LaneFrames frames_;
  bool predictor_was_lower_ = true;  ///< in the last step, of all; see Workspace
};

}  // namespace exmat::runtime
