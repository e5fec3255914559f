#pragma once

#include <Eigen/Core>

#include "runtime/sim/frame/deforming_inertia.h"
#include "runtime/sim/frame/spin.h"

namespace exmat::runtime {

/// Start of a step of a free body, for BDF2 of one that a host holds.
struct FreeStart {
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  Eigen::Quaterniond orientation = Eigen::Quaterniond::Identity();
  Eigen::Vector3d linear_momentum = Eigen::Vector3d::Zero(), angular_momentum = Eigen::Vector3d::Zero();
};

/// Pose and momenta of a free body: x = c + R (X + U q). World frame unless it says body frame. The momenta are
/// what it carries; spin and velocities follow from them.
struct FreeState {
  double mass = 0;                                                  ///< [kg]
  Eigen::Vector3d position = Eigen::Vector3d::Zero();               ///< c - c at rest [m]
  Eigen::Quaterniond orientation = Eigen::Quaterniond::Identity();  ///< R
  Eigen::Vector3d linear_momentum = Eigen::Vector3d::Zero();        ///< p [kg m/s]
  Eigen::Vector3d angular_momentum = Eigen::Vector3d::Zero();       ///< L about c [kg m^2/s]
  Eigen::Vector3d spin = Eigen::Vector3d::Zero();                   ///< omega, body frame [rad/s]
  Eigen::Vector3d applied_force = Eigen::Vector3d::Zero();          ///< the host's, beside State::applied_force [N]
  Eigen::Vector3d applied_torque = Eigen::Vector3d::Zero();         ///< about c [N m]
  Eigen::VectorXd momentum, momentum_previous;                      ///< [r] pi = qdot - sum_c omega_c A_c q
  FreeStart before{};                                               ///< likewise at the end of the step before
};

/// The motion of a free body within one step near obstacles or held by a host, where it is unknown: its centre of mass
/// at start_position + d, its rotation R_n exp([t]x). By backward Euler, or BDF2: see FreeFrame::move().
struct RigidUnknowns {
  double time_step = 0;                                           ///< [s]
  bool second_order = false;                                      ///< BDF2
  Eigen::Quaterniond last_turn = Eigen::Quaterniond::Identity();  ///< R_(n-1)^T R_n, for that
  Eigen::Matrix3d start_rotation = Eigen::Matrix3d::Identity();   ///< R_n
  Eigen::Matrix3d start_inertia = Eigen::Matrix3d::Zero();        ///< J at the first pose [kg m^2]
  Eigen::Vector3d expected_turn = Eigen::Vector3d::Zero();        ///< t of free flight at the first pose
  Eigen::Vector3d frozen_turn = Eigen::Vector3d::Zero();          ///< see BodyFrame::rigid_potential()
  Eigen::Vector3d next_frozen_turn = Eigen::Vector3d::Zero();

  /// c_v [1/s]
  double velocity_factor() const noexcept { return (second_order ? 1.5 : 1) / time_step; }
  /// omega at the end of the step, body frame, of a turn t.
  Eigen::Vector3d spin(const Eigen::Vector3d& turn) const noexcept;
};

/// Rotation of a free body within one step, and what it does to q: with the spin w(q, v) that keeps the angular
/// momentum and W = sum_c w_c A_c, pi = v - W q and
///   dpi/dt = W v + d/dq (1/2 w^T J w) - f_int + f_ext + f_example.
/// docs/step_in_detail.md, "Free bodies". r modes. No call allocates or throws.
struct FreeMotionWorkspace {
  FreeMotionWorkspace() = default;
  explicit FreeMotionWorkspace(const DeformingInertia& inertia);

  SpinProblem problem;                                        ///< spin equation of this step
  bool spin_is_given = false;                                 ///< near obstacles the spin is an unknown of its own
  bool turn_is_given = false;                                 ///< see turn_rigidly()
  Eigen::Vector3d turned_momentum = Eigen::Vector3d::Zero();  ///< L in the body frame at the end of a given turn
  SpinSolution solution;
  DeformingInertia::Moments moments;
  AlignedArray velocity_products;            ///< -A_c v, r each, of the last rotation_force()
  AlignedArray centre_products;              ///< likewise of velocity_centre
  AlignedArray scratch;                      ///< 3 r
  Eigen::VectorXd force, product, velocity;  ///< r
  Eigen::VectorXd velocity_centre;           ///< r, the last q_v
  Eigen::MatrixXd factors;                   ///< r x 12: (D + V)^T, J^-1 times that and times H^T, and scratch
  Eigen::MatrixXd gyroscopic;                ///< r x r
  FreeState moved;                           ///< at the end of the step
  RigidUnknowns unknowns;                    ///< near obstacles
};

/// The problem of the spin in this step, after external forces have changed the momenta of `body`. `dissipative`:
/// implicit Euler instead of implicit midpoint.
void begin_rotation(const FreeState& body, double time_step, bool dissipative, FreeMotionWorkspace& workspace) noexcept;

/// For a body that turns too far in the step for begin_rotation()'s problem: gives it the turn that a rigid body of its
/// shape and motion at the beginning makes, by implicit Euler in sub-steps of at most 0.3 rad or a thousandth of the
/// step. Keeps L exactly, and the energy of a rigid body from growing. The spin then follows from L in that frame.
void turn_rigidly(const DeformingInertia& frame, const Eigen::VectorXd& q, const Eigen::VectorXd& v, double time_step,
                  FreeMotionWorkspace& workspace) noexcept;

/// Moments at q and the spin at the end of the step for q and its velocity in workspace.velocity. False where there is
/// no such spin.
bool update_spin(const DeformingInertia& frame, const Eigen::VectorXd& q, FreeMotionWorkspace& workspace) noexcept;

/// workspace.force = d/dt (W q) + W v + d/dq (1/2 w^T J w), d/dt as the integrator has it: `rate` W q.
void rotation_force(const DeformingInertia& frame, double rate, FreeMotionWorkspace& workspace) noexcept;

/// update_spin() and rotation_force() for the velocity rate (q - q_v), q_v `velocity_centre` [r]. A_c v is then rate
/// times the difference of A_c q, which is at hand, and A_c q_v, which is found once for each q_v.
bool update_rotation(const DeformingInertia& frame, double rate, const Eigen::VectorXd& q,
                     const Eigen::VectorXd& velocity_centre, FreeMotionWorkspace& workspace) noexcept;

/// The rotation's part of the derivative of the gradient, v = c_v (q - q_v), after rotation_force(): with D = d(J
/// w)/dq, V = dh/dq and H = dh/dv, w of constant angular momentum gives (D + V - c_v H)^T J^-1 (D + V + c_v H). Adds
/// its symmetric part to the lower triangle, and what the centrifugal force softens where that is small beside inertia.
void add_rotation_stiffness(const DeformingInertia& frame, double velocity_factor, FreeMotionWorkspace& workspace,
                            Eigen::MatrixXd& hessian) noexcept;

/// Its antisymmetric part and -2 c_v W into workspace.gyroscopic. After add_rotation_stiffness().
void set_gyroscopic(const DeformingInertia& frame, double velocity_factor, FreeMotionWorkspace& workspace) noexcept;

/// The product of that matrix with `x` [r] into workspace.product, without the matrix.
void gyroscopic_product(const DeformingInertia& frame, double velocity_factor, const Eigen::VectorXd& x,
                        FreeMotionWorkspace& workspace) noexcept;

/// Takes position and momenta of workspace.moved, turns the body by the solution and sets pi = v - W q and, for
/// Newmark, its rate; `v` [r] is that of the end of the step, `a` [r] = rate (v - ...) so far.
void commit_free_motion(double rate, const Eigen::VectorXd& v, const FreeMotionWorkspace& workspace, Eigen::VectorXd& a,
                        FreeState& body) noexcept;

}  // namespace exmat::runtime
