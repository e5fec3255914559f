#pragma once

#include <cstdint>

#include "common/core/arrays.h"

namespace exmat::precompute {

/// Nodes for polynomials of total degree up to n on the simplex of K barycentric coordinates: the recursive ones of
/// Isaac 2020 over Chebyshev-Lobatto nodes, symmetric, the corners among them; on each edge and face those of fewer
/// coordinates. [N x K], one for each row of `exponents` [N x K], which adds up to n.
RowMatrix interpolation_nodes(const IndexMatrix& exponents);

/// Evenly spread points inside every edge, face, ... of the simplex of K coordinates, `per_dimension` times its
/// dimension on each of them, in a low-discrepancy sequence (Roberts 2018). [count x K]
RowMatrix spread_points(Eigen::Index coordinates, int per_dimension);

/// Weights where `together` of the coordinates but the first are positive, which ones and their shares at random, and
/// the first one's in about every second row. [count x K]
RowMatrix some_together(Eigen::Index coordinates, Eigen::Index together, int count, std::uint64_t seed);

}  // namespace exmat::precompute
