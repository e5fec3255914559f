#pragma once

#include <optional>
#include <string>
#include <vector>

#include "precompute/examples/example_finish.h"
#include "precompute/modes/linear_modes.h"
#include "precompute/targets/target_space.h"
#include "precompute/training/roll_out.h"
#include "precompute/training/training_stage.h"

namespace exmat::precompute {

/// Stages of a body before it has a basis.
struct BodyStages {
  const AssetConfig& asset;
  const ObjectInput& object;
  const ElasticSystem& system;
  const LinearModes& modes;
  const Eigen::MatrixXd& derivatives;
  const PoseFitter* fitter;  ///< null without examples
  const std::vector<TargetSpace>& targets;
  std::vector<bool> elastic;  ///< true for each target whose force may be elastic
};

/// The energy reference of all targets.
EnergyReference reference_of(const BodyStages& stages);

/// The runs of training, and what they were made of.
struct Motions {
  TrainingSet set;
  TrainingChains chains;
  TrainingLoads loads;
  bool general = false;                  ///< the basis is to serve other loads, too
  std::string reason;                    ///< whose loads they are
  std::optional<CubatureData> elements;  ///< those of a body of many modes that ran them in place of the full space

  /// Number of snapshots of the run of the very loads, which comes first.
  Eigen::Index own_columns() const { return loads.duration > 0 ? set.runs.chain_ends.front() : 0; }
};

/// A basis, and how far bodies of it and of the modal basis with all elements (those of the body that ran the motions)
/// are from the full space.
struct BasisChoice {
  Eigen::MatrixXd basis;  ///< f x r
  bool trained = false;
  RollOut exact, modal;
};

/// The modal basis, and of one that has learned from the motions whichever is nearer to the full space in the held-out
/// runs; with basis.tolerance of the smallest size whose error is below it. `body` has /object and, where it is thrown,
/// /contact. Throws WorkError where no size meets the tolerance.
BasisChoice choose_basis(const BodyStages& stages, const ReducedModel& body, const Motions* motions);

/// Puts the basis into a model that has /object, with shape space, examples and targets in it.
void put_basis(const BodyStages& stages, const Eigen::MatrixXd& basis, ReducedModel& model);

/// Distance of the body with this cubature from the full space in the held-out runs, with forces by its elements alone;
/// `model` has the basis.
RollOut cubature_roll_out(const BodyStages& stages, const ReducedModel& model, const CubatureData& cubature,
                          const Motions& motions);

/// Distance of the finished model from the full space in the held-out runs.
RollOut final_roll_out(const BodyStages& stages, const ReducedModel& model, const Motions& motions);

}  // namespace exmat::precompute
