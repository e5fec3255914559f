#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>
#include <optional>
#include <vector>

#include "runtime/sim/step/model.h"

namespace exmat::runtime {

/// Where a free body is and how it moves: x = c + R (X + U q). World frame unless it says body frame. The momenta are
/// what it carries; spin and velocities follow from them.
struct FreeState {
  double mass = 0;                                                  ///< [kg]
  Eigen::Vector3d position = Eigen::Vector3d::Zero();               ///< c - c at rest [m]
  Eigen::Quaterniond orientation = Eigen::Quaterniond::Identity();  ///< R
  Eigen::Vector3d linear_momentum = Eigen::Vector3d::Zero();        ///< p [kg m/s]
  Eigen::Vector3d angular_momentum = Eigen::Vector3d::Zero();       ///< L about c [kg m^2/s]
  Eigen::Vector3d spin = Eigen::Vector3d::Zero();                   ///< omega, body frame [rad/s]
  Eigen::Vector3d applied_force = Eigen::Vector3d::Zero();          ///< of the caller, beside State::applied_force [N]
  Eigen::Vector3d applied_torque = Eigen::Vector3d::Zero();         ///< about c [N m]
  Eigen::VectorXd momentum, momentum_previous;                      ///< [r] pi = qdot - sum_c omega_c A_c q
};

/// What one example force carries from step to step. K examples, d target coordinates.
struct ExampleState {
  Eigen::VectorXd weights;  ///< [K] of the last step, after the bias; (1, 0, ...) before the first
  Eigen::VectorXd target;   ///< [d] y of the last step, see TargetSolver; empty with a table
  bool has_target = false;
  bool target_converged = false;
};

/// All that a body carries from step to step. r modes.
struct State {
  Eigen::VectorXd q, v;                    ///< [r] reduced displacement, velocity
  Eigen::VectorXd q_previous, v_previous;  ///< [r] one step earlier (BDF2)
  Eigen::VectorXd a;                       ///< [r] acceleration (Newmark)
  Eigen::VectorXd applied_force;           ///< [r] generalised force of the caller, added to the scene's
  std::int64_t step = 0;                   ///< steps taken
  double time = 0;                         ///< step * time_step [s]
  double elastic_energy = 0;               ///< E(q) [J]
  std::vector<ExampleState> examples;      ///< one for each of the model's example forces
  ContactState contacts;                   ///< what touches; sized for its scene by prepare_contacts()
  bool begins_anew = true;                 ///< the last step was no smooth one: the first, or one near obstacles
  std::optional<FreeState> body;           ///< of a free body
  std::optional<CarriedState> carried;     ///< of a body whose fixed part a motion carries

  /// [r] momentum of q: that of a free body, else qdot.
  const Eigen::VectorXd& momentum() const { return body ? body->momentum : v; }
  const Eigen::VectorXd& momentum_previous() const { return body ? body->momentum_previous : v_previous; }
};

/// Linear velocity [m/s] and spin [rad/s] of a free body in the world frame, and where it is.
struct FreeMotion {
  Eigen::Vector3d position = Eigen::Vector3d::Zero();               ///< c - c at rest [m]
  Eigen::Quaterniond orientation = Eigen::Quaterniond::Identity();  ///< R
  Eigen::Vector3d linear_velocity = Eigen::Vector3d::Zero();        ///< [m/s]
  Eigen::Vector3d angular_velocity = Eigen::Vector3d::Zero();       ///< [rad/s]
};

FreeMotion motion_of(const FreeState& body);
FreeMotion motion_of(const MotionSample& frame);

/// Sets how a free body moves; its q and v stay. `moments` is scratch: with it nothing is allocated.
void set_motion(const Model& model, const FreeMotion& motion, RigidFrame::Moments& moments, State& state);
void set_motion(const Model& model, const FreeMotion& motion, State& state);

/// Sizes what a state remembers of its contacts with so many obstacles.
void prepare_contacts(const Model& model, std::size_t obstacles, State& state);

/// At rest at time 0.
State make_state(const Model& model);

/// At the pose q with the velocity v at time 0.
State make_state(const Model& model, const Eigen::VectorXd& q, const Eigen::VectorXd& v);

}  // namespace exmat::runtime
