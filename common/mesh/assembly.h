#pragma once

#include <Eigen/SparseCore>
#include <cstdint>
#include <vector>

#include "common/mesh/tet_mesh.h"

namespace exmat {

/// Compressed rows, both triangles of a symmetric matrix stored, column indices ascending.
using SparseMatrix = Eigen::SparseMatrix<double, Eigen::RowMajor>;

/// [n x n] consistent linear-FEM mass with unit density: integral of N_i N_j [m^3].
SparseMatrix scalar_mass(const TetMesh& mesh);

/// [n x n] consistent mass weighted by the density of each tet [kg].
SparseMatrix scalar_mass(const TetMesh& mesh, const Eigen::VectorXd& density);

/// [n x n] linear-FEM stiffness of the Laplacian: integral of grad N_i . grad N_j [m]. Natural (Neumann) boundary.
SparseMatrix laplacian_stiffness(const TetMesh& mesh);

/// [3n x 3n] stiffness of linear elasticity, the Hessian of every material's energy at rest [N/m].
SparseMatrix elastic_stiffness(const TetMesh& mesh, const TetMaterials& materials);

/// [3n x 3n] Kronecker product with the 3 x 3 identity: the mass of interleaved displacements.
SparseMatrix expand_to_vectors(const SparseMatrix& scalar);

/// [k x k] rows and columns `kept` (ascending) of a square matrix.
SparseMatrix submatrix(const SparseMatrix& matrix, const std::vector<std::int32_t>& kept);

}  // namespace exmat
