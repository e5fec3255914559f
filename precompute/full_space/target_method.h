#pragma once

#include <Eigen/Core>

namespace exmat::precompute {

/// Another way to find targets than the elastic energy of all tets (FullSpaceExamples::target()): what a method that
/// the full space is compared with puts in its place. Targets z [d] are in the coordinates of
/// FullSpaceExamples::pose_basis().
class TargetMethod {
 public:
  virtual ~TargetMethod() = default;

  struct Solved {
    bool converged = false;
    int iterations = 0;
  };
  /// Improves z [d] for the weights [K] >= 0, not all 0.
  virtual Solved solve(const Eigen::VectorXd& weights, Eigen::VectorXd& z) const = 0;
};

}  // namespace exmat::precompute
