#pragma once

#include <Eigen/Core>
#include <functional>

namespace exmat::precompute {

/// Value at `x` [d] and, into `gradient` [d], its derivative.
using SmoothFunction = std::function<double(const Eigen::VectorXd& x, Eigen::VectorXd& gradient)>;

struct MinimiserSettings {
  double gradient_tolerance = 0;  ///< |gradient| at which to stop [Limit: > 0]
  int max_iterations = 200;
};

struct MinimiserReport {
  bool converged = false;
  int iterations = 0;
  int evaluations = 0;
  double value = 0;
  double gradient_norm = 0;
};

/// Minimises from `x` by limited-memory BFGS with a More-Thuente line search (PETSc TAO, "lmvm"); `x` [d] becomes the
/// last iterate. Throws WorkError where PETSc fails; what `function` throws is thrown on.
MinimiserReport minimise(const SmoothFunction& function, const MinimiserSettings& settings, Eigen::VectorXd& x);

}  // namespace exmat::precompute
