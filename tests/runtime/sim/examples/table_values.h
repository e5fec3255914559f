#pragma once

#include <Eigen/Core>
#include <cstdint>

#include "runtime/sim/examples/target_table.h"
#include "tests/support/random.h"

namespace exmat::test {

/// Inside the simplex.
inline Eigen::VectorXd random_weights(Eigen::Index count, std::uint32_t seed) {
  const Eigen::VectorXd logarithms = (0.5 + 0.5 * random_vector(count, seed).array()).log();
  return logarithms / logarithms.sum();
}

inline Eigen::VectorXd evaluate(const runtime::TargetTable& table, const Eigen::VectorXd& weights) {
  auto workspace = table.make_workspace();
  Eigen::VectorXd target(table.modes());
  table.evaluate(weights, workspace, target);
  return target;
}

inline Eigen::MatrixXd derivative(const runtime::TargetTable& table, const Eigen::VectorXd& weights) {
  auto workspace = table.make_workspace();
  Eigen::MatrixXd jacobian(table.modes(), table.examples());
  table.derivative(weights, workspace, jacobian);
  return jacobian;
}

}  // namespace exmat::test
