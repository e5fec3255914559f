#pragma once

#include <string>

#include "common/model/reduced_model.h"
#include "precompute/training/roll_out.h"
#include "precompute/training/training_loads.h"

namespace exmat::precompute {

/// What is known of a bundle that was trained, to be put into words.
struct FidelityInput {
  const ReducedModel& model;  ///< whole
  const RollOut& final_run;   ///< of it
  const RollOut& exact_run;   ///< of its basis with all elements
  const RollOut& modal_run;   ///< of the basis of modes with all elements
  const TrainingRuns& training;
  const TrainingRuns& heldout;
  bool trained = false;                             ///< which basis it has
  std::string loads;                                ///< whose loads these are
  const TrainingLoads& tried;                       ///< what the runs were under
  TrainingSpace space = TrainingSpace::kFullSpace;  ///< what the runs had
};

/// /fidelity, with one sentence of advice: what of basis, cubature, eigenfunctions and training has most of the error.
FidelityData fidelity_of(const FidelityInput& input);

}  // namespace exmat::precompute
