#include "runtime/sim/lanes/lane_workspace.h"

#include <algorithm>
#include <utility>

namespace exmat::runtime {

bool can_step_side_by_side(const Model& model, const StepScene& scene) noexcept {
  if (model.internal_force.polynomial()) return false;
  return std::ranges::none_of(scene.examples, [](const ExampleSettings& own) { return elastic_factor(own) > 0; });
}

LaneWorkspace::LaneWorkspace(const Model& model, const StepScene& scene, std::size_t bodies)
    : bodies_(bodies, Workspace(model, scene)), frames_(model) {
  if (std::cmp_less(bodies, kFewestLanes)) return;
  model.internal_force.cubature().prepare_lanes();
  const Eigen::Index modes = model.modes();
  forms_ = LaneForms(modes);
  const Eigen::Index unknowns = modes + (touches(model, scene) ? model.frame->rigid_unknowns() : 0);
  for (AlignedArray* vectors : {&q_, &previous_, &trial_, &gradient_, &trial_gradient_, &direction_})
    *vectors = AlignedArray(unknowns * kLanes);
  for (AlignedArray* vectors : {&internal_, &linear_, &frozen_, &next_frozen_, &offset_, &elastic_scratch_})
    *vectors = AlignedArray(modes * kLanes);
  for (AlignedArray* matrices : {&quadratic_, &stiffness_}) *matrices = AlignedArray(lane_triangle(modes));
  for (AlignedArray* matrices : {&factor_, &new_factor_}) *matrices = AlignedArray(lane_triangle(unknowns));
  for (const ExampleModel& examples : model.examples) examples_.emplace_back(examples);
}

void LaneWorkspace::set_profile(Profile* profile) {
  for (Workspace& body : bodies_) body.profile = profile;
}

}  // namespace exmat::runtime
