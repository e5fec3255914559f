#pragma once

#include <Eigen/Core>

#include "common/model/reduced_model.h"
#include "runtime/sim/frame/deforming_inertia.h"
#include "runtime/sim/frame/motion.h"

namespace exmat::runtime {

/// A constrained body whose fixed part a prescribed motion carries: x = p(t) + R(t) (X + U q), X the rest mesh in the
/// world. With w and w' the spin and its rate in the moving frame, W = sum_c w_c A_c, y = X + U q about the centre of
/// mass c at rest and a_c the acceleration that the motion gives c,
///   qddot = 2 W qdot + W' q + d/dq (1/2 w^T J w) - (sum m X x U)^T w' + U^T M R^T (g - a_c) - f_int + ...,
/// which are the equations of a free body (docs/step_in_detail.md, "Free bodies") with w given. r modes. No call
/// allocates or throws.
struct CarriedInertia {
  DeformingInertia moments;
  Eigen::Matrix3Xd spin_load;  ///< 3 x r, sum m X x U about the centre of mass
};

/// Frame of a carried body, and the kinetic energy of its motion; part of a State.
struct CarriedState {
  MotionSample frame;
  double kinetic_energy = 0;      ///< whole motion in the world [J]
  double potential_of_frame = 0;  ///< potential of gravity beyond that of q [J]
};

struct CarriedWorkspace {
  CarriedWorkspace() = default;
  explicit CarriedWorkspace(const CarriedInertia& carried);

  MotionSample frame;                                                                   ///< at the end of the step
  Eigen::Vector3d spin = Eigen::Vector3d::Zero(), spin_rate = Eigen::Vector3d::Zero();  ///< moving frame
  DeformingInertia::Moments moments;
  AlignedArray scratch;
  Eigen::VectorXd force, product, velocity;  ///< r, product padded(r)
  Eigen::MatrixXd gyroscopic;                ///< r x r
};

/// Takes the frame for what follows.
void set_frame(const MotionSample& frame, CarriedWorkspace& workspace) noexcept;

/// Adds the part of the inertial force that depends on the frame alone, and gravity [m/s^2], to `force` [r].
void add_carried_load(const CarriedInertia& carried, const RowMatrix& gravity_load, const Eigen::Vector3d& gravity,
                      const CarriedWorkspace& workspace, Eigen::VectorXd& force) noexcept;

/// workspace.force = 2 W v + W' q + d/dq (1/2 w^T J w) at q and the velocity in workspace.velocity.
void carried_force(const CarriedInertia& carried, const Eigen::VectorXd& q, CarriedWorkspace& workspace) noexcept;

/// -(2 c_v W + W') into workspace.gyroscopic: the derivative of -force for v = c_v (q - q_v), but for the centrifugal
/// part.
void set_gyroscopic(const CarriedInertia& carried, double velocity_factor, CarriedWorkspace& workspace) noexcept;

/// The product of that matrix with `x` [r] into workspace.product, without the matrix.
void gyroscopic_product(const CarriedInertia& carried, double velocity_factor, const Eigen::VectorXd& x,
                        CarriedWorkspace& workspace) noexcept;

/// Energies at the end of a step, after carried_force(): frame of the workspace.
CarriedState carried_state(const CarriedInertia& carried, const RowMatrix& gravity_load, const Eigen::Vector3d& gravity,
                           const Eigen::VectorXd& q, const Eigen::VectorXd& v,
                           const CarriedWorkspace& workspace) noexcept;

}  // namespace exmat::runtime
