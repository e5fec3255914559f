#pragma once

#include <cmath>

#include "common/model/reduced_model.h"
#include "precompute/shape_space/laplace_basis.h"

namespace exmat::precompute {

/// The filter of the example force on displacements of n vertices, in each axis: P u = M Phi Phi^T (M_s/V) u, M the
/// mass and M_s that of density 1. docs/method.md, "Direct projection".
struct FilterFunctions {
  RowMatrix analysis;     ///< n x m, (M_s/V) Phi
  RowMatrix synthesis;    ///< n x m, M Phi
  bool symmetric = true;  ///< P is: where density is uniform

  FilterFunctions() = default;
  FilterFunctions(const LaplaceBasis& object, const TetMesh& mesh, const Eigen::VectorXd& density);

  /// W over `analysis`, with P = W W^T, of a symmetric filter [kg^(1/2)].
  double root_over_analysis() const { return std::sqrt(synthesis.norm() / analysis.norm()); }
};

/// [K x 3m] slopes of the load of the weights problem in Phi^T (M_s/V) u, row 3i + axis: h = h0 + slopes c.
RowMatrix weight_slopes(const LaplaceBasis& object, Weighting weighting, const ExampleSet& set);

}  // namespace exmat::precompute
