#pragma once

#include <memory>
#include <vector>

#include "common/model/reduced_model.h"
#include "precompute/fem/elastic_system.h"
#include "precompute/training/training_runs.h"
#include "runtime/sim/step/model.h"
#include "runtime/sim/step/scene.h"

namespace exmat::precompute {

/// Frames of one chain, every kStepsPerSnapshot steps.
struct ChainFrames {
  std::vector<Eigen::VectorXd> deformations;   ///< 3n
  std::vector<Eigen::VectorXd> displacements;  ///< 3n, from rest, world
  std::int64_t segments = 0;                   ///< that were run to their ends
  std::int64_t steps = 0;
  bool finite = true;  ///< else the run ends where it was not
};

/// The run time's body of a model whose example forces are to be these, of its groups in order. Throws InputError.
std::unique_ptr<const runtime::Model> stepped_model(const ReducedModel& data, EnergyReference reference,
                                                    const std::vector<runtime::ExampleSettings>& examples);

/// Runs each chain with a reduced body; `reference` is that of all targets.
std::vector<ChainFrames> run_reduced_chains(const ReducedModel& model, EnergyReference reference,
                                            const std::vector<Chain>& chains, const TrainingRunOptions& options);

/// The same as runs to learn from, in place of those in full space. The budget does not count here.
TrainingRuns reduced_training_runs(const ReducedModel& model, EnergyReference reference,
                                   const std::vector<Chain>& chains, const ElasticSystem& system,
                                   const TrainingRunOptions& options);

}  // namespace exmat::precompute
