#pragma once

#include <string>
#include <vector>

#include "precompute/examples/example_stage.h"
#include "precompute/fem/elastic_system.h"
#include "precompute/shape_space/pose_map.h"
#include "precompute/solvers/semidefinite_solver.h"

namespace exmat::precompute {

/// Makes the poses of a shape stage fit for the body, and brings them into its modal basis.
class PoseFitter {
 public:
  /// `solver` is that of the system's stiffness, asked only for regions and here alone; `highest` [1/s^2] the squared
  /// frequency of the highest linear mode: the basis resolves nothing finer. The others are kept by reference.
  PoseFitter(const AssetConfig& asset, const ObjectInput& object, const ElasticSystem& system,
             const SemidefiniteSolver* solver, double highest, ShapeStage& stage);

  /// [f x k] displacements of all poses, groups in order: what the basis is to hold.
  Eigen::MatrixXd fields() const;

  /// Puts shape space, projections and examples into a model that has its modal basis; logs and records what of each
  /// example is lost. The stage is used up.
  void finish(ReducedModel& model, std::vector<std::string>& warnings);

 private:
  struct Finished {
    ExampleSet examples;
    ProjectionData projection;
  };
  Finished finish_group(std::size_t group, const ReducedModel& model);

  const AssetConfig& asset_;
  const ObjectInput& object_;
  const ElasticSystem& system_;
  ShapeStage& stage_;
  FieldClamp clamp_;
  std::vector<PoseFields> poses_;        // of the groups
  std::vector<Eigen::MatrixXd> fields_;  // f x (K-1), of the groups
};

}  // namespace exmat::precompute
