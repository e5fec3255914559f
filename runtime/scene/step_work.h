#pragma once

#include "runtime/sim/step/stepper.h"

namespace exmat::runtime {

/// Computations and reads of a step beyond the flops that Profile counts. Lower bounds: a share of a limit that is
/// built on them is never flattered.
struct StepWork {
  double weights_flops = 0;
  double target_flops = 0;
  double other_flops = 0;  ///< products with r x r matrices: quadratic form, filter, damping
  double bytes = 0;        ///< constant arrays and r x r matrices, each pass over one counted once

  StepWork& operator+=(const StepWork& more);
};

/// Work of the step that this report is of.
StepWork step_work(const Model& model, const StepScene& scene, const StepReport& report);

/// Flops of a solution for the target that took so many iterations, likewise.
double target_flops(const TargetSolver& solver, int iterations);

}  // namespace exmat::runtime
