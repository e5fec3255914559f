#pragma once

#include <Eigen/Core>
#include <cstdint>

namespace exmat::runtime {

/// Forces of the host on a body, as the sums that its state has of them.
struct AppliedForces {
  std::int64_t id = -1;                                            ///< -1: of those that have none
  Eigen::VectorXd modes{}, vertices{};                             ///< as State::applied_force and vertex_force
  Eigen::Vector3d force{Eigen::Vector3d::Zero()}, torque = force;  ///< on the frame, world [N], [N m]
  Eigen::VectorXd load{};                                          ///< [3n] as exmat_body::load, or empty as that is
};

}  // namespace exmat::runtime
