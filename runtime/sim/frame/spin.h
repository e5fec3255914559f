#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace exmat::runtime {

/// [w]x.
Eigen::Matrix3d cross_matrix(const Eigen::Vector3d& w) noexcept;

/// exp([t]x), Rodrigues; exact to rounding for small t too.
Eigen::Matrix3d rotation_of(const Eigen::Vector3d& t) noexcept;

/// The same rotation as a quaternion.
Eigen::Quaterniond quaternion_of(const Eigen::Vector3d& t) noexcept;

/// Right Jacobian of exp: exp([t + dt]x) = exp([t]x) exp([J dt]x) to first order.
Eigen::Matrix3d right_jacobian(const Eigen::Vector3d& t) noexcept;

/// One step of a body's rotation: R' = R exp([t]x), t = offset + factor w, w the spin (body frame) that has the angular
/// momentum R'^T L = J w + h at the end of the step. factor = dt, offset = 0 loses energy (implicit Euler); factor =
/// dt/2, offset = dt/2 w_n keeps energy and |L| of a rigid body exactly (implicit midpoint).
struct SpinProblem {
  Eigen::Vector3d momentum;  ///< R^T L with the frame R of the beginning of the step
  Eigen::Vector3d offset = Eigen::Vector3d::Zero();
  double factor = 0;  ///< [s]
};

struct SpinSolution {
  Eigen::Vector3d spin, rotation;  ///< w and t
  bool converged = false;
};

/// By Newton's method from `guess`, to rounding.
SpinSolution solve_spin(const SpinProblem& problem, const Eigen::Matrix3d& inertia,
                        const Eigen::Vector3d& deformation_momentum, const Eigen::Vector3d& guess) noexcept;

}  // namespace exmat::runtime
