#pragma once

#include <Eigen/Core>

namespace exmat::runtime {

/// The linear example force within one step, where qdot = c_v (q - q_v): f = -kappa (P_s q - g) - c_kappa P_s qdot
/// = -k P_s (q - q_c) + kappa g, g the pull of the target, k = kappa + c_kappa c_v, q_c = c_kappa c_v q_v / k.
/// docs/step_in_detail.md, "The incremental potential".
struct ExampleForce {
  double stiffness = 0;    ///< k > 0
  Eigen::VectorXd centre;  ///< q_c [r]
  Eigen::VectorXd pull;    ///< kappa g [r]
};

}  // namespace exmat::runtime
