#pragma once

#include <Eigen/Core>

namespace exmat {

/// R - I of the rotation R that is nearest to F = I + H: that of the polar decomposition F = R S, S symmetric, where
/// det F > 0, and a proper one too where it is not. With the digits of H, however small.
Eigen::Matrix3d polar_rotation_less_identity(const Eigen::Matrix3d& H);

/// The rotation R itself.
inline Eigen::Matrix3d nearest_rotation(const Eigen::Matrix3d& F) {
  const Eigen::Matrix3d identity = Eigen::Matrix3d::Identity();
  return identity + polar_rotation_less_identity(F - identity);
}

}  // namespace exmat
