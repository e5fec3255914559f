#pragma once

#include <Eigen/Core>
#include <vector>

#include "common/model/reduced_model.h"
#include "precompute/cubature/cubature.h"
#include "precompute/targets/target_space.h"

namespace exmat::precompute {

/// Parts of an elastic example force: the energy of a body whose undeformed shape is the target.
/// docs/method.md, "Force".
struct TargetElasticityInput {
  const TetMesh& mesh;
  const TetMaterials& materials;
  const RowMatrix& basis;          ///< U, 3n x r
  RowMatrix displacements;         ///< Y, 3n x d, that hold the targets
  Eigen::VectorXd shares;          ///< n_t, of the tets in the energy: 1 of the whole body
  const TargetSpace& targets;      ///< examples and table in coordinates y
  Eigen::MatrixXd target_reduced;  ///< r x d, U^T M Y
};

/// By all elements that have a share, with the weight 1; no error measured.
TargetElasticityData all_target_elements(const TargetElasticityInput& input);

/// Elements and weights chosen so that the force is right at pairs of a pose and a target, by greedy selection with
/// swaps (docs/method.md, "Cubature"), and measured at held-out pairs. Poses are those of `source`, at several
/// distances from the target. Number, tolerance and seed are those of `options`; where the tolerance cannot be met, as
/// many elements as 10 r.
TargetElasticityData target_elasticity(const TargetElasticityInput& input, const PoseSource& source,
                                       const CubatureOptions& options);

/// The held-out error of that many elements and their weights, as TargetElasticityData has it; weights without shares.
double target_elasticity_error(const TargetElasticityInput& input, const PoseSource& source,
                               const CubatureOptions& options, const IndexVector& elements,
                               const Eigen::VectorXd& weights);

}  // namespace exmat::precompute
