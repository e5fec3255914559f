#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "common/core/arrays.h"
#include "common/mesh/assembly.h"

namespace exmat::precompute {

/// Linear elastodynamics of a body, M a + K u = f, with the clamped displacements eliminated. f free degrees of
/// freedom.
struct ElasticSystem {
  SparseMatrix full_mass;               ///< 3n x 3n [kg]
  SparseMatrix full_stiffness;          ///< 3n x 3n [N/m]
  std::vector<std::int32_t> free_dofs;  ///< f, ascending; all 3n of a free body
  SparseMatrix mass, stiffness;         ///< f x f
  Eigen::MatrixXd null_space;           ///< f x 6, M-orthonormal rigid motions of a free body; f x 0 of a clamped one
  Eigen::MatrixXd rigid;                ///< f x 6, the free rows of the rigid motions of the body

  bool constrained() const { return null_space.cols() == 0; }
  /// [f x k] free rows of [3n x k] fields.
  Eigen::MatrixXd restrict(const Eigen::MatrixXd& fields) const;
  /// [3n x 3] forces of a unit acceleration along each axis [kg].
  Eigen::MatrixXd unit_weights() const;
  /// [3n x k] fields with zeros on the clamped rows, of [f x k].
  Eigen::MatrixXd extend(const Eigen::MatrixXd& free_rows) const;
};

/// `fixed` [n] flags the clamped vertices; all zero: a free body. Throws InputError (without a file) where the clamped
/// vertices are all there are, or leave the body a rigid motion: they must be at least three and not lie on one line.
ElasticSystem build_elastic_system(const TetMesh& mesh, const TetMaterials& materials, const FlagVector& fixed);

/// The same of any mass and stiffness [3n x 3n] of `nodes` [n x 3].
ElasticSystem eliminate_fixed(const VertexArray& nodes, SparseMatrix mass, SparseMatrix stiffness,
                              const FlagVector& fixed);

/// True if the vertices of `nodes` [n x 3] that `fixed` [n] flags leave the body no rigid motion: they are at least
/// three and do not lie on one line.
bool are_clamp(const VertexArray& nodes, const FlagVector& fixed);

/// [3n x 6] translations along and rotations about the axes through the centre of mass, M-orthonormal.
Eigen::MatrixXd rigid_motions(const VertexArray& nodes, const SparseMatrix& mass);

/// Total mass [kg] and centre of mass [m] of the [3n x 3n] mass matrix of nodes.
struct MassProperties {
  double mass = 0;
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
};
MassProperties mass_properties(const VertexArray& nodes, const SparseMatrix& mass);

}  // namespace exmat::precompute
