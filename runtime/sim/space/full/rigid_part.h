#pragma once

#include <Eigen/Core>

#include "runtime/sim/frame/placement.h"
#include "runtime/sim/space/full/full_space.h"

namespace exmat::runtime {

/// Scratch of a RigidPart, sized once; what the last place() found. Fields are [4 x n].
struct RigidWorkspace {
  RigidWorkspace() = default;
  explicit RigidWorkspace(const FullSpace& space);

  Eigen::Vector3d centre = Eigen::Vector3d::Zero();        ///< centre of mass, world [m]
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();  ///< that fits the rest shape best in the mass
  Eigen::Matrix3d inertia = Eigen::Matrix3d::Zero();       ///< about the centre [kg m^2]
  Eigen::Matrix4Xd arms;                                   ///< from the centre [m]
  Eigen::Matrix4Xd weighted;                               ///< M times these [kg m]
};

/// Rigid motions of a free body in full space: where it stands, its momenta, and what of a velocity they are. The frame
/// is that of a free reduced body: at the centre of mass, with sum m X x (R^T (x - c) - X) = 0. Immutable; fields are
/// those of FullSpace. No call but the constructor allocates.
class RigidPart {
 public:
  RigidPart(const FullSpace& space, const VertexArray& rest);

  double mass() const { return mass_; }
  const Eigen::Vector3d& centre_at_rest() const { return centre_; }
  const Eigen::Matrix4Xd& rest() const { return rest_; }  ///< X, about the centre [m]

  /// Centre of mass of the body displaced by `u`, world [m].
  Eigen::Vector3d centre(const double* u) const noexcept {
    return centre_ + (as_columns(u).lazyProduct(masses_) / mass_).head<3>();
  }
  /// Finds centre, rotation and inertia of the body displaced by `u`.
  void place(const double* u, RigidWorkspace& workspace) const noexcept;

  /// Momenta of the velocities `v` where place() was called, and the rigid motion that has such momenta.
  FrameMomenta momenta(const double* v, const RigidWorkspace& workspace) const noexcept;
  /// Sum and torque about the centre of forces there.
  FrameMomenta sums(const double* forces, const RigidWorkspace& workspace) const noexcept;
  FrameVelocity motion(const FrameMomenta& momenta, const RigidWorkspace& workspace) const noexcept;
  /// Adds a rigid motion to `v`; takes off the one that has its momenta.
  static void add_motion(const FrameVelocity& motion, const RigidWorkspace& workspace, double* v) noexcept;
  void remove_motion(const RigidWorkspace& workspace, double* v) const noexcept;
  /// Rotation of the frame of the body displaced by `u`, and A^-1 of spin(), world.
  struct Turn {
    Eigen::Matrix3d rotation, inverse;
  };
  Turn turn(const double* u) const noexcept;
  /// Takes what turns the frame along off forces that see the deformation in it: they then have no torque.
  void remove_torque(const Turn& turn, const double* u, double* forces) const noexcept;
  /// Takes the rigid part off forces that see velocities less remove_motion(), where place() was called; body at `u`.
  void remove_rigid_force(const double* u, const RigidWorkspace& workspace, double* forces) const noexcept;

  /// Angular velocity of the fitted frame while the vertices move by `v`, world [rad/s].
  Eigen::Vector3d spin(const double* v, const RigidWorkspace& workspace) const noexcept;

 private:
  using Field = Eigen::Map<const Eigen::Matrix4Xd>;
  Field as_columns(const double* field) const { return {field, 4, masses_.size()}; }

  FullSpace::Scalar mass_matrix_;
  Eigen::VectorXd masses_;  // n, its row sums
  double mass_ = 0;
  Eigen::Vector3d centre_;
  Eigen::Matrix4Xd rest_, weighted_rest_;  // X and M X
};

}  // namespace exmat::runtime
