#pragma once

#include "precompute/full_space/mesh_elasticity.h"

namespace exmat::precompute {

/// Energy that keeps tets from being turned inside out: of each, V (g - J)^3 / J where it has less than the share g =
/// kGuarded of its volume V, J its share. Infinite at J = 0, smooth where it begins, and nothing elsewhere. Lengths
/// without a unit.
class VolumeGuard {
 public:
  static constexpr double kGuarded = 0.2;

  /// `elasticity` of all vertices of the mesh; mesh and elasticity outlive the guard.
  VolumeGuard(const TetMesh& mesh, const MeshElasticity& elasticity);

  /// At positions x [n x 3].
  double energy(const VertexArray& x) const;
  /// Adds `strength` times its derivative and its second derivative, of each tet the nearest positive semidefinite one.
  /// Returns `strength` times the energy.
  double add(const VertexArray& x, double strength, Eigen::VectorXd& gradient, LowerTriangle& hessian) const;

 private:
  const TetMesh& mesh_;
  const MeshElasticity& elasticity_;
  Eigen::VectorXd volumes_;
};

}  // namespace exmat::precompute
