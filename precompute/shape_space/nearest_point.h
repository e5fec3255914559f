#pragma once

#include "common/mesh/tet_mesh.h"

namespace exmat::precompute {

/// Points of a tet mesh in barycentric coordinates.
struct BarycentricPoints {
  IndexVector tets;                                  ///< k
  Eigen::Matrix<double, Eigen::Dynamic, 4> weights;  ///< k x 4, >= 0, rows sum to 1
  Eigen::VectorXd distances;                         ///< k, from the queried points

  /// [k x c] values of a piecewise linear field given [n x c] on the vertices.
  Eigen::MatrixXd interpolate(const TetMesh& mesh, const Eigen::MatrixXd& vertex_values) const;
};

/// The nearest point of the body for each of [k x 3] points; those inside it are their own.
BarycentricPoints nearest_points(const TetMesh& mesh, const VertexArray& points);

}  // namespace exmat::precompute
