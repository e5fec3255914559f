#pragma once

#include <Eigen/LU>

#include "common/elastic/material.h"
#include "common/model/reduced_model.h"

namespace exmat::precompute {

/// dE/dF of an example's energy density at displacement gradient H, the example's own being H_example.
template <typename Material>
Eigen::Matrix3d example_stress(const Material& material, EnergyReference reference, const Eigen::Matrix3d& H,
                               const Eigen::Matrix3d& H_example, const LameParameters& lame) {
  if (reference == EnergyReference::kRest) return material.first_piola_kirchhoff(H - H_example, lame);
  const Eigen::Matrix3d example = Eigen::Matrix3d::Identity() + H_example;
  const Eigen::Matrix3d inverse = example.inverse();
  const Eigen::Matrix3d relative = (H - H_example) * inverse;
  return example.determinant() * material.first_piola_kirchhoff(relative, lame) * inverse.transpose();
}

}  // namespace exmat::precompute
