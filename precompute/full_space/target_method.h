#pragma once

#include <Eigen/Core>

#include "precompute/solvers/minimiser.h"

namespace exmat::precompute {

/// Another way to find targets than the elastic energy of all tets (FullSpaceExamples::target()): what a method that
/// the full space is compared with puts in its place. Targets z [d] are in the coordinates of
/// FullSpaceExamples::pose_basis().
class TargetMethod {
 public:
  virtual ~TargetMethod() = default;

  /// Improves z [d] for the weights [K] >= 0, not all 0.
  virtual MinimiserReport solve(const Eigen::VectorXd& weights, Eigen::VectorXd& z) const = 0;
};

}  // namespace exmat::precompute
