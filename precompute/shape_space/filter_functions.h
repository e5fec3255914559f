#pragma once

#include <cmath>

#include "common/model/reduced_model.h"
#include "precompute/shape_space/laplace_basis.h"

namespace exmat::precompute {

/// The filter of the example force on displacements of n vertices, in each axis: P = W W^T, W = m^(1/2) (M_s/V) Phi, m
/// the mass of the body and M_s the mass matrix of density 1. docs/method.md, "Force".
struct FilterFunctions {
  RowMatrix analysis;             ///< n x m, (M_s/V) Phi
  double root_over_analysis = 0;  ///< m^(1/2) [kg^(1/2)]

  FilterFunctions() = default;
  FilterFunctions(const LaplaceBasis& object, const TetMesh& mesh, const Eigen::VectorXd& density);
};

/// [m] ProjectionData::filter_scale of descriptors of these weights.
Eigen::VectorXd filter_scale(const LaplaceBasis& object, const Eigen::VectorXd& weights, const TetMesh& mesh,
                             const Eigen::VectorXd& density);

/// [K x 3m] slopes of the load of the weights problem in Phi^T (M_s/V) u, row 3i + axis: h = h0 + slopes c.
RowMatrix weight_slopes(const LaplaceBasis& object, Weighting weighting, const ExampleSet& set);

}  // namespace exmat::precompute
