#pragma once

#include "precompute/modes/linear_modes.h"

namespace exmat::precompute {

struct BasisInput {
  const ElasticSystem& system;
  const LinearModes& modes;
  const Eigen::MatrixXd& derivatives;  ///< f x k(k+1)/2, see modal_derivatives
  double body_size;                    ///< L, diagonal of the bounding box [m]
  Eigen::MatrixXd example_fields;      ///< f x (K-1) displacements that the basis must hold, or no columns
};

/// Modes that example fields [f x N] ask for: kBasisSize, or as many principal components as hold each field to 2 %,
/// and half of kBasisSize beside them.
int basis_size_for(const ElasticSystem& system, const Eigen::MatrixXd& fields);

/// [f x r] mass-orthonormal basis, orthogonal to the rigid motions of a free body: the example fields (their principal
/// components where they would leave less to modes than half of r or of kBasisSize), then the principal components of
/// scaled modes and modal derivatives in their complement. Scaling: docs/method.md, section 2, after Barbic and James
/// 2005, section 4.1. Throws InputError (without a file) where the snapshots span fewer than r dimensions.
Eigen::MatrixXd modal_basis(const BasisInput& input, int size);

/// The same of `snapshots` [f x N] of motions: their principal components in the norm M + K / omega_5^2, which weighs
/// displacement and strain alike. What modal_basis() is made of is mixed in with 3 % of their norm, so that loads which
/// no run had find the lowest modes. Example fields come first where the basis would lose 15 % of one, since a scene
/// need not show the poses that a host will ask for, and where they are so many that basis_size_for() takes more for
/// them.
/// With `grows` the basis has more than `size` modes instead: those that the fields need beside it to lose 0.5 %.
/// With `general` both have the same norm, in M + K / omega_1^2: for loads that the snapshots do not know. Throws as
/// modal_basis() does, of all this.
Eigen::MatrixXd trained_basis(const BasisInput& input, const Eigen::MatrixXd& snapshots, bool general, int size,
                              bool grows = false);

}  // namespace exmat::precompute
