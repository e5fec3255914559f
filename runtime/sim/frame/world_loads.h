#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <limits>
#include <optional>
#include <vector>

#include "runtime/sim/frame/motion.h"
#include "runtime/sim/frame/skeleton.h"

namespace exmat::runtime {

/// A constant world-space force on each of some vertices that acts in every step whose midpoint lies in [start, end).
struct ScriptedForce {
  Eigen::VectorXd force;                                 ///< [r] generalised, of a body that stays where it is
  double start = 0;                                      ///< [s]
  double end = std::numeric_limits<double>::infinity();  ///< [s]
  Eigen::Vector3d total = Eigen::Vector3d::Zero();       ///< sum over the vertices [N]
  Eigen::Vector3d lever = Eigen::Vector3d::Zero();       ///< mean of the vertices' X about the centre of mass [m]
  Eigen::Matrix3Xd mean_basis{};                         ///< [3 x r] mean of their U; these three for a body that moves
  Eigen::VectorXd on_vertices{};                         ///< [f] world [N], of a body in full space

  bool acts_at(double time) const noexcept { return start <= time && time < end; }
};

/// Loads on a body from outside, except contacts and what its host applies.
struct WorldLoads {
  Eigen::Vector3d gravity = Eigen::Vector3d::Zero();  ///< [m/s^2]; moves a free body
  Eigen::VectorXd gravity_force;                      ///< [r], gravity_load^T g
  std::vector<ScriptedForce> forces;
  std::optional<RigidMotion> carrier;  ///< motion of the fixed part of a carried body
  std::optional<BonePlay> animation;   ///< moves the bones of a body on a skeleton; none: its host does

  /// True if a force begins or ends between two times.
  bool forces_jump(double from, double to) const noexcept {
    return std::ranges::any_of(forces,
                               [=](const ScriptedForce& force) { return force.acts_at(from) != force.acts_at(to); });
  }
};

}  // namespace exmat::runtime
