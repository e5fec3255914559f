#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <optional>
#include <span>

#include "runtime/sim/frame/skeleton.h"

namespace exmat::runtime {

/// Weight of an example by the rotation q of a bone, Skeleton::own_turn(): of its angle t about an axis, from 0 to 1
/// between two angles; or (1 - (d / radius)^2)^2 of its distance d from another rotation, 0 beyond the radius.
struct ExampleDriver {
  Eigen::Index example = 1;
  std::size_t bone = 0;
  Eigen::Vector3d axis = Eigen::Vector3d::UnitX();  ///< unit
  std::array<double, 2> angles{0, 1};               ///< of weights 0 and 1, not equal [rad]
  std::optional<Eigen::Quaterniond> rotation{};     ///< that d is measured from, in place of the two
  double radius = 1;                                ///< [rad]

  double value(const Eigen::Quaterniond& q) const noexcept;
};

/// Weights of the examples [K] at these poses of the bones: of each the product of its drivers, the rest pose first
/// with what they leave of 1; if they are more than 1 together, over their sum. No allocation, no exception.
void drive(std::span<const ExampleDriver> drivers, const Skeleton& skeleton, const BonePoses& bones,
           Eigen::VectorXd& weights) noexcept;

}  // namespace exmat::runtime
