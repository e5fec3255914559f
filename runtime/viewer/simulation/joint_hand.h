#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>

namespace exmat::viewer {

/// A hand that drags a joint of a body on bones.
struct JointHand {
  int id = 0;
  std::size_t body = 0, joint = 0;
  Eigen::Vector3d target = Eigen::Vector3d::Zero();  ///< world [m]
};

/// Turns the bone that `joint` hangs on about that bone's own joint, with all that hangs on it, by `share` of the angle
/// after which `joint` lies in the direction of `target`, world [m]. A root is shifted by that share of its way there.
/// `parents` [b]: -1 of a root; `transforms` [12b]: bones to the world, 3 x 4 by rows.
void turn_toward(std::size_t joint, const Eigen::Vector3d& target, double share, std::span<const std::int64_t> parents,
                 std::span<double> transforms);

}  // namespace exmat::viewer
