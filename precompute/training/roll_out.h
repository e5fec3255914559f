#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "common/model/reduced_model.h"
#include "precompute/training/training_runs.h"

namespace exmat::precompute {

/// Distances of a reduced body from the full space in the same runs: in the norm |x|_M over the root mean
/// square of the size, as docs/error_metrics.md has them, in the runs of the kind of load (Segment::kind) whose `shape`
/// is largest. Infinite where a reduced run does not stay finite.
struct RollOut {
  std::string kind{};             ///< that of these runs
  double position = 0;            ///< root mean square of world positions, over displacements from rest
  double shape = 0;               ///< likewise of deformations
  double end = 0;                 ///< likewise in the last frame of each run
  double settled = 0;             ///< likewise over the last tenth of each run
  std::int64_t worst_vertex = 0;  ///< in the runs of all kinds
  double worst_distance = 0;      ///< its distance, of deformations [m]
};

/// Runs the chains of `full`, which kept its positions, with the reduced body; `reference` is that of all targets.
RollOut roll_out(const ReducedModel& model, EnergyReference reference, const std::vector<Chain>& chains,
                 const TrainingRuns& full, const SparseMatrix& mass, const TrainingRunOptions& options);

}  // namespace exmat::precompute
