#pragma once

#include <string>
#include <vector>

#include "common/model/reduced_model.h"
#include "precompute/training/roll_out.h"
#include "precompute/training/training_stage.h"

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
  const TrainingChains& chains;                     ///< the runs
  TrainingSpace space = TrainingSpace::kFullSpace;  ///< space of the runs
};

/// /fidelity, with advice: which of basis, cubature, eigenfunctions and training has most of the error, under which
/// kind of load it is largest, what the runs tried and what they did not.
FidelityData fidelity_of(const FidelityInput& input);

/// Words about a body that is far from the full space, or farther than one of modes alone, which training made worse;
/// empty where it is neither.
std::string warning_of(const FidelityData& fidelity);

/// Words for the kinds and sizes of the loads of these runs, how long they last and their damping. Gravity is left out
/// of a `free` body, which it does not deform.
std::string tried_text(const std::vector<Chain>& runs, const TrainingRunOptions& options, bool free);
/// Words for the kinds of loads that these runs lack.
std::string untried_text(const std::vector<Chain>& runs, bool free);

}  // namespace exmat::precompute
