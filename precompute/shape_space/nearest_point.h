#pragma once

#include "common/mesh/tet_mesh.h"
#include "precompute/fem/assembly.h"

namespace exmat::precompute {

/// Points of a tet mesh in barycentric coordinates.
struct BarycentricPoints {
  IndexVector tets;                                  ///< k
  Eigen::Matrix<double, Eigen::Dynamic, 4> weights;  ///< k x 4, >= 0, rows sum to 1
  Eigen::VectorXd distances;                         ///< k, from the queried points

  /// [k x n] matrix that interpolates piecewise linear fields given on the vertices of the mesh.
  SparseMatrix interpolation(const TetMesh& mesh) const;
};

/// The nearest point of the body for each of [k x 3] points; those inside it are their own.
BarycentricPoints nearest_points(const TetMesh& mesh, const VertexArray& points);

}  // namespace exmat::precompute
