#include "runtime/sim/step/example_drivers.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace exmat::runtime {

double ExampleDriver::value(const Eigen::Quaterniond& q) const noexcept {
  if (rotation) {
    const double share = std::min(1.0, q.angularDistance(*rotation) / radius);
    return (1 - share * share) * (1 - share * share);
  }
  const double angle = std::remainder(2 * std::atan2(q.vec().dot(axis), q.w()), 2 * std::numbers::pi);
  return std::clamp((angle - angles[0]) / (angles[1] - angles[0]), 0.0, 1.0);
}

void drive(std::span<const ExampleDriver> drivers, const Skeleton& skeleton, const BonePoses& bones,
           Eigen::VectorXd& weights) noexcept {
  weights.setZero();
  for (const ExampleDriver& driver : drivers) weights[driver.example] = 1;
  for (const ExampleDriver& driver : drivers)
    weights[driver.example] *= driver.value(skeleton.own_turn(driver.bone, bones));
  const double sum = weights.sum();
  if (sum > 1)
    weights /= sum;
  else
    weights[0] = 1 - sum;
}

}  // namespace exmat::runtime
