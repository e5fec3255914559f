#pragma once

#include <cstdint>
#include <vector>

#include "common/config/asset_config.h"
#include "common/model/reduced_model.h"
#include "precompute/modes/linear_modes.h"
#include "precompute/targets/target_space.h"
#include "precompute/training/training_loads.h"
#include "precompute/training/training_runs.h"

namespace exmat::precompute {

/// The motions that basis and cubature learn from, and others, of loads drawn anew, that they are judged by.
struct TrainingSet {
  TrainingRuns runs, heldout;
};

/// Chains of the two.
struct TrainingChains {
  std::vector<Chain> runs, heldout;
  TrainingRunOptions options;
};

/// Members that the stage cache keeps.
template <typename Archive>
void pass_members(Archive& archive, TrainingSet& value) {
  pass_all(archive, value.runs, value.heldout);
}

/// A body that runs are made of, before it has a basis.
struct TrainingInput {
  const ReducedModel& model;  ///< /object, the shape space and example sets, /contact where it is thrown
  const ElasticSystem& system;
  const LinearModes& modes;
};

TrainingBody training_body(const TrainingInput& input);

/// Draws the training's segments and those that are held out: two, of a body that is thrown three. If the loads are not
/// a scene's and of several kinds, one of all loads and one of each kind by itself are held out; that of gravity lasts
/// three times as long as the others.
TrainingChains draw_training(const TrainingInput& input, TrainingLoads loads, const TrainingConfig& config,
                             std::uint64_t seed);

/// Runs them in full space, with the targets of the model's whole body, if it has examples, then of its regions.
TrainingSet run_training(const TrainingInput& input, const std::vector<TargetSpace>& targets,
                         const TrainingChains& chains);

}  // namespace exmat::precompute
