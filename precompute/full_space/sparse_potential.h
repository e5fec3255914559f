#pragma once

#include <Eigen/Core>

#include "precompute/full_space/mesh_elasticity.h"
#include "runtime/sim/solver/newton.h"

namespace exmat::precompute {

/// Potential that minimise_step() minimises in d, of a body or of several.
class SparsePotential {
 public:
  SparsePotential() = default;
  SparsePotential(const SparsePotential&) = delete;
  SparsePotential& operator=(const SparsePotential&) = delete;
  virtual ~SparsePotential() = default;

  /// Evaluates at the d where the potential was started; evaluate() anywhere.
  virtual runtime::PotentialEvaluation evaluate_first(const Eigen::VectorXd& d, Eigen::VectorXd& gradient) = 0;
  virtual runtime::PotentialEvaluation evaluate(const Eigen::VectorXd& d, Eigen::VectorXd& gradient) = 0;
  virtual runtime::PotentialValue value(const Eigen::VectorXd& d) const = 0;
  /// The d of the last evaluate() is the next iterate.
  virtual void accept(runtime::PotentialEvaluation& evaluation) = 0;

  /// The sparse part of the Hessian at the d of the last evaluate(), and the product with all of it. With projected
  /// tangents at the first iterate, damping is frozen anew: evaluate again.
  virtual void assemble(const Eigen::VectorXd& d, runtime::Tangent tangent) = 0;
  virtual LowerTriangle& hessian() = 0;
  virtual Eigen::VectorXd product(const Eigen::VectorXd& x) const = 0;
};

}  // namespace exmat::precompute
