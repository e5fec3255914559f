#pragma once

#include <Eigen/Core>

#include "common/core/arrays.h"
#include "common/core/decompositions.h"
#include "runtime/sim/examples/target.h"
#include "runtime/sim/examples/target_table.h"

namespace exmat::precompute {

/// Weights [n x K] and p*(w) there [n x d], in the coordinates y of TargetSolver.
struct TargetSamples {
  RowMatrix weights, minima;

  void append(const TargetSamples& more);
};

/// Tables as the run time decodes them, in the coordinates y of TargetSolver.
class TableError {
 public:
  TableError(const runtime::TargetSolver& target, Eigen::Index examples);

  double scale() const { return scale_; }  ///< |y| of the largest example

  /// [n x d] at weights [n x K].
  RowMatrix decode(const runtime::TargetTable& table, const RowMatrix& weights) const;
  /// [n] in the energy norm at rest, relative to the largest example.
  Eigen::VectorXd errors(const runtime::TargetTable& table, const TargetSamples& samples) const;

 private:
  double scale_ = 0;
  Eigen::HouseholderQR<Eigen::MatrixXd> basis_;  ///< Z
};

/// [n x N] the Bernstein polynomials at weights [n x K].
Eigen::MatrixXd collocation(const runtime::BernsteinBasis& basis, const RowMatrix& weights);

}  // namespace exmat::precompute
