#pragma once

#include <vector>

#include "common/mesh/assembly.h"
#include "common/mesh/tet_mesh.h"

namespace exmat::precompute {

/// As-rigid-as-possible energy of a tet mesh, E(x) = sum_t V_t |F_t - R_t|^2 / sum_t V_t, R_t the rotation nearest to
/// F_t. Sorkine and Alexa 2007; Chao et al. 2010.
class ArapEnergy {
 public:
  explicit ArapEnergy(const TetMesh& rest);

  double energy(const VertexArray& positions) const;

  /// n_t rotations nearest to the deformation gradients: the local step.
  std::vector<Eigen::Matrix3d> rotations(const VertexArray& positions) const;

  /// [n x n] S and [n x 3] b of the global step: with the rotations held, E(x) = tr(x^T S x - 2 x^T b) + constant.
  const SparseMatrix& stiffness() const { return stiffness_; }
  VertexArray load(const std::vector<Eigen::Matrix3d>& rotations) const;

  /// [n x 3] dE/dx = 2 (S x - b(R(x))).
  VertexArray gradient(const VertexArray& positions) const;

  /// Share of the volume in tets with det F < 0.
  double inverted_fraction(const VertexArray& positions) const;

  /// Share of the volume in tets whose volume is less than 1 / `factor` or more than `factor` times what the body as a
  /// whole makes of its own.
  double squeezed_fraction(const VertexArray& positions, double factor) const;

 private:
  Eigen::Matrix3d deformation_gradient(const VertexArray& positions, Eigen::Index tet) const;

  TetArray tets_;
  std::vector<Eigen::Matrix<double, 4, 3>> gradients_;
  Eigen::VectorXd volumes_;  // of sum 1
  SparseMatrix stiffness_;
};

}  // namespace exmat::precompute
