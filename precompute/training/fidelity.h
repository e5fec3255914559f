#pragma once

#include <string>

#include "common/model/reduced_model.h"
#include "precompute/training/roll_out.h"
#include "precompute/training/training_loads.h"

namespace exmat::precompute {

/// A trained bundle and its runs, to be put into words.
struct FidelityInput {
  const ReducedModel& model;  ///< whole
  const RollOut& final_run;   ///< run of the model
  const RollOut& exact_run;   ///< run of its basis with all elements
  const RollOut& modal_run;   ///< run of the basis of modes with all elements
  const TrainingRuns& training;
  const TrainingRuns& heldout;
  bool trained = false;                             ///< which basis it has
  std::string loads;                                ///< whose loads these are
  const TrainingLoads& tried;                       ///< loads of the runs
  TrainingSpace space = TrainingSpace::kFullSpace;  ///< space of the runs
};

/// /fidelity, with one sentence of advice: what of basis, cubature, eigenfunctions and training has most of the error.
FidelityData fidelity_of(const FidelityInput& input);

}  // namespace exmat::precompute
