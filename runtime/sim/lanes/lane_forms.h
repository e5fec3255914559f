#pragma once

#include "runtime/sim/lanes/lane_numbers.h"
#include "runtime/sim/step/state.h"
#include "runtime/sim/step/workspace.h"

namespace exmat::runtime {

/// Start of a step of kLanes bodies of r modes: poses, external forces, forms of the integrators and
/// damping. Sized once.
struct LaneForms {
  LaneForms() = default;
  explicit LaneForms(Eigen::Index modes)
      : start(modes * kLanes),
        external(modes * kLanes),
        velocity_centre(modes * kLanes),
        acceleration_centre(modes * kLanes) {}

  /// After BodyStep::begin() in that workspace.
  void set(Eigen::Index lane, const StepScene& scene, const State& state, const Workspace& workspace) noexcept {
    const StepForm& form = workspace.form;
    for (Eigen::Index c = 0; c < state.q.size(); ++c) {
      start[c * kLanes + lane] = state.q[c];
      external[c * kLanes + lane] = workspace.external_force[c];
      velocity_centre[c * kLanes + lane] = form.velocity_centre[c];
      acceleration_centre[c * kLanes + lane] = form.acceleration_centre[c];
    }
    velocity_factor[lane] = form.velocity_factor;
    acceleration_factor[lane] = form.acceleration_factor;
    mass_damping[lane] = scene.mass_damping;
    stiffness_damping[lane] = scene.stiffness_damping;
  }

  LaneForm arrays() const noexcept {
    return {start.size() / kLanes,
            start.data(),
            external.data(),
            velocity_centre.data(),
            acceleration_centre.data(),
            velocity_factor.data(),
            acceleration_factor.data(),
            mass_damping.data(),
            stiffness_damping.data()};
  }

  AlignedArray start, external, velocity_centre, acceleration_centre;  ///< r x kLanes
  LaneNumbers velocity_factor = LaneNumbers::Zero(), acceleration_factor = LaneNumbers::Zero(),
              mass_damping = LaneNumbers::Zero(), stiffness_damping = LaneNumbers::Zero();
};

}  // namespace exmat::runtime
