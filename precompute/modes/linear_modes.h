#pragma once

#include "common/elastic/material.h"
#include "precompute/fem/elastic_system.h"
#include "precompute/solvers/eigenpairs.h"

namespace exmat::precompute {

/// Vibration modes K psi = omega^2 M psi of a clamped body, or of a free one without its six rigid motions.
struct LinearModes {
  Eigen::VectorXd eigenvalues;  ///< k, omega^2 [1/s^2], ascending
  Eigen::MatrixXd modes;        ///< f x k, mass-orthonormal
};

/// Members that the stage cache keeps.
template <typename Archive>
void pass_members(Archive& archive, LinearModes& value) {
  pass_all(archive, value.eigenvalues, value.modes);
}
LinearModes linear_modes(const ElasticSystem& system, const SemidefiniteSolver& solver, int count);

/// [f x k(k+1)/2] modal derivatives phi_ij, i <= j, column pair_index(i, j): K phi_ij = -d2f/du2 [psi_i, psi_j], in the
/// complement of the rigid motions. Barbic and James 2005, section 4.
Eigen::MatrixXd modal_derivatives(const TetMesh& mesh, const TetMaterials& materials, const ElasticSystem& system,
                                  const SemidefiniteSolver& solver, const Eigen::MatrixXd& modes);

/// Column of the pair i <= j: 00, 01, 11, 02, 12, 22, ...
constexpr Eigen::Index pair_index(Eigen::Index i, Eigen::Index j) { return j * (j + 1) / 2 + i; }

}  // namespace exmat::precompute
