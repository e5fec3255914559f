#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "runtime/sim/frame/motion.h"
#include "runtime/sim/space/full/full_space.h"

namespace exmat::runtime {

/// A body in full space whose fixed vertices a rigid motion carries: where these are, and what the others do beside it.
/// The body moves in the world: its inertia takes no fictitious forces. Immutable; fields are those of FullSpace, of
/// driven fixed vertices. No call but the constructor allocates.
class CarriedPart {
 public:
  CarriedPart(const FullSpace& space, const VertexArray& rest);

  const Eigen::Matrix4Xd& rest() const { return rest_; }  ///< X of each place, world [m]

  /// Displacement by the frame of a place at rest, from where it was meshed [m].
  Eigen::Vector3d displacement(const MotionSample& frame, Eigen::Index place) const noexcept {
    const Eigen::Vector3d rest = rest_.col(place).head<3>();
    return frame.to_world(rest) - rest;
  }
  Eigen::Vector3d velocity(const MotionSample& frame, Eigen::Index place) const noexcept {
    return frame.velocity_at(frame.to_world(rest_.col(place).head<3>()));
  }
  Eigen::Vector3d acceleration(const MotionSample& frame, Eigen::Index place) const noexcept {
    return frame.acceleration_of(rest_.col(place).head<3>());
  }
  /// Sets the fixed vertices of the displacement field `u`.
  void place_fixed(const MotionSample& frame, Eigen::VectorXd& u) const noexcept;

  /// The velocity `v` [f] of the body displaced by `q` [f] beside that of the frame, in the frame, as a field; fixed
  /// vertices have none.
  void own_velocity(const MotionSample& frame, const Eigen::VectorXd& q, const Eigen::VectorXd& v,
                    Eigen::VectorXd& own) const noexcept;
  /// From way of its own in the frame to the whole way `d` from the field `u` where the frame was to where it is.
  void carry(const MotionSample& from, const MotionSample& to, const Eigen::VectorXd& u,
             Eigen::VectorXd& d) const noexcept;
  /// Velocity of the frame at the body displaced by the field `u`, times `factor`.
  void frame_velocity(const MotionSample& frame, const double* u, double factor, Eigen::VectorXd& v) const noexcept;

  /// Potential energy of the fixed vertices [J], zero where they were meshed.
  double fixed_potential(const MotionSample& frame, const Eigen::Vector3d& gravity) const noexcept;

 private:
  std::vector<std::int32_t> number_at_;  // of each place of a vertex that moves, as FullSpace::number_at()
  Eigen::Matrix4Xd rest_;
  double fixed_mass_ = 0;
  Eigen::Vector3d fixed_centre_ = Eigen::Vector3d::Zero();
};

}  // namespace exmat::runtime
