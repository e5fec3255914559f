#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace exmat::runtime {

/// Placement of a body's frame: x = position + rotation (X + u - origin), with X + u the body in the world as its
/// rest mesh and its deformation place it.
struct Placement {
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();        ///< frame's origin at rest, world [m]
  Eigen::Vector3d position = Eigen::Vector3d::Zero();      ///< its origin now, world [m]
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();  ///< frame to world

  Eigen::Vector3d to_world(const Eigen::Vector3d& point) const noexcept {
    return position + rotation * (point - origin);
  }
};

/// Velocities of a frame: its material point at x has linear + angular x (x - position).
struct FrameVelocity {
  Eigen::Vector3d linear = Eigen::Vector3d::Zero();   ///< world [m/s]
  Eigen::Vector3d angular = Eigen::Vector3d::Zero();  ///< world [rad/s]

  Eigen::Vector3d at(const Eigen::Vector3d& arm) const noexcept { return linear + angular.cross(arm); }
};

/// The motion of a body's frame as scenes, trajectories and hosts say it.
struct FrameMotion {
  Eigen::Vector3d position = Eigen::Vector3d::Zero();               ///< origin less its place at rest [m]
  Eigen::Quaterniond orientation = Eigen::Quaterniond::Identity();  ///< frame to world
  Eigen::Vector3d linear_velocity = Eigen::Vector3d::Zero();        ///< world [m/s]
  Eigen::Vector3d angular_velocity = Eigen::Vector3d::Zero();       ///< world [rad/s]
};

struct FrameMomenta {
  Eigen::Vector3d linear = Eigen::Vector3d::Zero();   ///< [kg m/s]
  Eigen::Vector3d angular = Eigen::Vector3d::Zero();  ///< about the centre of mass [kg m^2/s]
};

}  // namespace exmat::runtime
