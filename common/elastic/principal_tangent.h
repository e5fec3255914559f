#pragma once

#include <Eigen/Core>

#include "common/elastic/material.h"

namespace exmat {

/// The tangent dP/dF of an isotropic material at F = U diag(s) V^T in the modes of its eigensystem, all of them U D V^T
/// of unit norm. Pair k of axes (i, j) = (1, 2), (2, 0), (0, 1). Smith, de Goes and Kim 2019.
struct PrincipalTangent {
  Eigen::Matrix3d stretch;  ///< between the three modes of stretch, D = e_i e_i^T: d2Psi / ds_i ds_j
  Eigen::Vector3d twist;    ///< eigenvalues of the modes D = (e_j e_i^T - e_i e_j^T) / sqrt(2)
  Eigen::Vector3d flip;     ///< eigenvalues of the modes D = (e_j e_i^T + e_i e_j^T) / sqrt(2)
};

/// F = U diag(s) V^T with rotations U and V: only the last and smallest s may be negative.
struct SignedSvd {
  Eigen::Matrix3d U, V;
  Eigen::Vector3d stretches;
};
SignedSvd signed_svd(const Eigen::Matrix3d& F);

/// The 9 x 9 tangent that these modes make up.
Matrix9 tangent_of(const PrincipalTangent& principal, const SignedSvd& svd);

/// Negative eigenvalues set to zero.
PrincipalTangent positive_semidefinite(const PrincipalTangent& principal);

/// The nearest positive semi-definite matrix to Material::tangent(H, lame), from its eigensystem.
template <typename Material>
Matrix9 projected_tangent(const Eigen::Matrix3d& H, const LameParameters& lame) {
  const SignedSvd svd = signed_svd(H + Eigen::Matrix3d::Identity());
  return tangent_of(positive_semidefinite(Material::principal_tangent(svd.stretches, lame)), svd);
}

}  // namespace exmat
