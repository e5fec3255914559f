#pragma once

#include <string>

#include "common/mesh/assembly.h"
#include "common/mesh/tet_mesh.h"
#include "common/model/reduced_model.h"

namespace exmat::precompute {

/// Laplace-Beltrami eigenfunctions of a mesh brought to centroid 0 and volume 1, the constant one dropped.
/// docs/method.md, "Shape space".
struct LaplaceBasis {
  Eigen::VectorXd eigenvalues;                         ///< k, ascending, dimensionless
  Eigen::MatrixXd eigenfunctions;                      ///< n x k, phi^T mass phi = I
  SparseMatrix mass;                                   ///< n x n, M_s / V
  VertexArray vertices;                                ///< n x 3, normalised positions
  double volume = 0;                                   ///< V [m^3]
  Eigen::Vector3d centroid = Eigen::Vector3d::Zero();  ///< [m]
};

/// Members that the stage cache keeps.
template <typename Archive>
void pass_members(Archive& archive, LaplaceBasis& value) {
  pass_all(archive, value.eigenvalues, value.eigenfunctions, value.mass, value.vertices, value.volume, value.centroid);
}

/// The first `count` eigenpairs; `name` is for messages.
LaplaceBasis laplace_basis(const TetMesh& mesh, Eigen::Index count, const std::string& name);

/// That of a bundle with /object and /shape_space.
LaplaceBasis laplace_basis_of(const ReducedModel& model);

/// The first `count` of its functions.
LaplaceBasis first_functions(LaplaceBasis basis, Eigen::Index count);

/// [n x 3] positions of a mesh of positive volume, moved to centroid 0 and scaled to volume 1.
VertexArray normalised_positions(const TetMesh& mesh);

/// [k x 3] coefficients Phi^T mass X of a field on the vertices of the basis's mesh.
Eigen::MatrixXd coefficients(const LaplaceBasis& basis, const VertexArray& field);

}  // namespace exmat::precompute
