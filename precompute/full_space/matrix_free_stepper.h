#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "precompute/full_space/full_space_stepper.h"
#include "runtime/sim/space/full/full_step.h"

namespace exmat::precompute {

/// Steps of a body as step() has them, by runtime::FullStep: of a clamped one the same to the tolerance of the scene,
/// of a free one, whose frame takes part in its integrator there, to the order of the step; several times as fast.
/// Refers to the model.
class MatrixFreeStepper {
 public:
  explicit MatrixFreeStepper(const FullSpaceModel& model) : model_(model), targets_(model.examples.size()) {}

  /// Takes what acts on the body in the next steps; false, and nothing is set, where it cannot step with that: example
  /// forces of a filter that is not symmetric, obstacles of a model without contact vertices.
  bool set(const FullSpaceScene& scene);

  FullSpaceReport step(FullSpaceState& state);

 private:
  void set_targets(const FullSpaceState& state, runtime::FullStep& step, std::vector<runtime::ExampleState>& examples,
                   FullSpaceReport& report);

  const FullSpaceModel& model_;
  runtime::StepScene scene_;
  std::optional<runtime::FullWorkspace> workspace_;
  std::vector<std::optional<runtime::TargetSolver::Workspace>> targets_;
  runtime::ContactWorkspace contact_;
};

/// Steps of a body by MatrixFreeStepper or, with what that cannot have, by step(). Refers to the model.
class FullSpaceStepper {
 public:
  explicit FullSpaceStepper(const FullSpaceModel& model) : model_(model), fast_(model) {}

  void set(const FullSpaceScene& scene);
  FullSpaceReport step(FullSpaceState& state);

 private:
  const FullSpaceModel& model_;
  MatrixFreeStepper fast_;
  bool is_fast_ = false;
  FullSpaceScene scene_;
  std::optional<FullSpaceWorkspace> workspace_;  // where it is not fast
};

}  // namespace exmat::precompute
