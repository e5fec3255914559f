#pragma once

#include <string>

#include "precompute/shape_space/laplace_basis.h"

namespace exmat::precompute {

/// A mesh as alignment sees it, with its first functions and its surface: at centroid 0, an object or rest example of
/// volume 1, a pose as large as it is beside its rest example.
struct AlignedShape {
  TetMesh mesh;           ///< normalised
  LaplaceBasis basis;     ///< K functions of it at volume 1; its vertices are those of `mesh`
  TriangleArray surface;  ///< outward
};

/// Number of eigenpairs that alignment works with; fewer where the mesh has fewer.
constexpr Eigen::Index kAlignmentFunctions = 60;

/// Scale and rotation that bring a mesh to its rest example.
struct Placing {
  double size = 1;                                         ///< length over that of a body of volume 1
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();  ///< applied to its positions
};

/// [n x 3] vertices about their centroid, of a body of this size, rotated.
VertexArray placed_positions(const TetMesh& mesh, const Placing& placing);

/// At least kAlignmentFunctions and `functions`, bounded by the mesh. `name` is for messages.
AlignedShape aligned_shape(const TetMesh& mesh, Eigen::Index functions, const std::string& name,
                           const Placing& placing = {});

/// The orthogonal factor of a matrix with orthonormal rows or columns, whichever are fewer.
Eigen::MatrixXd polar_factor(const Eigen::MatrixXd& matrix);

/// [n_a x 3] positions of b carried to the vertices of a by a functional map C [k_a x k_b]: Phi_a C Phi_b^T M_b X_b. In
/// the frame of b, centroid 0.
VertexArray carried_positions(const AlignedShape& a, const AlignedShape& b, const Eigen::MatrixXd& map);

}  // namespace exmat::precompute
