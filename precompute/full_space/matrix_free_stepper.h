#pragma once

#include <Eigen/Core>
#include <optional>

#include "precompute/full_space/full_space_stepper.h"
#include "runtime/sim/space/full/full_step.h"

namespace exmat::precompute {

/// Steps of a body as step() has them, by runtime::FullStep: of a clamped one the same to the tolerance of the scene,
/// of a free one, whose frame takes part in its integrator there, to the order of the step; several times as fast.
/// Refers to the model.
class MatrixFreeStepper {
 public:
  explicit MatrixFreeStepper(const FullSpaceModel& model) : model_(model) {}

  /// Takes what acts on the body in the next steps; false, and nothing is set, where it cannot step with that:
  /// obstacles, example forces of regions or of a filter that is not symmetric, elastic ones of a free body, Newmark's
  /// integrator.
  bool set(const FullSpaceScene& scene);

  FullSpaceReport step(FullSpaceState& state);

 private:
  const FullSpaceModel& model_;
  runtime::StepScene scene_;
  std::optional<runtime::FullWorkspace> workspace_;
  std::optional<runtime::TargetSolver::Workspace> target_;
};

}  // namespace exmat::precompute
