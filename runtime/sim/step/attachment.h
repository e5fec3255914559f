#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

namespace exmat::runtime {

/// How a frame of a host holds a patch of a body: each vertex where it is in the frame; their mean alone; their mean by
/// a spring and a damper.
enum class AttachmentKind { kFixed, kBall, kSpring };

/// A patch of a body in full space that a frame of a host holds. No two hold the same vertex.
struct Attachment {
  std::int64_t id = 0;
  AttachmentKind kind = AttachmentKind::kFixed;
  std::vector<std::int32_t> vertices;                            ///< k, of the mesh, that move
  Eigen::VectorXd shares;                                        ///< [k] of the mean, of sum 1
  Eigen::Matrix3Xd places;                                       ///< [3 x k] of the vertices in the frame [m]
  double stiffness = 0, damping = 0;                             ///< of a spring [N/m], [N s/m]
  double break_force = std::numeric_limits<double>::infinity();  ///< [N]

  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();  ///< of the frame, at the end of the next step
  Eigen::Vector3d position = Eigen::Vector3d::Zero();      ///< world [m]
  Eigen::Matrix3d rotation_before = rotation;              ///< likewise at the end of the last step
  Eigen::Vector3d position_before = position;

  Eigen::Vector3d force = Eigen::Vector3d::Zero();   ///< on the frame, of the last step [N]
  Eigen::Vector3d torque = Eigen::Vector3d::Zero();  ///< about its origin [N m]
  bool broken = false;                               ///< the force was larger than it bears: it holds no longer

  bool holds() const noexcept { return !broken; }
  Eigen::Vector3d target(Eigen::Index k) const noexcept { return position + rotation * places.col(k); }
  /// Where the mean is held.
  Eigen::Vector3d anchor() const noexcept { return position + rotation * (places * shares); }
  Eigen::Vector3d anchor_before() const noexcept { return position_before + rotation_before * (places * shares); }
};

/// Whether one of them holds.
inline bool is_held(std::span<const Attachment> attachments) noexcept {
  return std::ranges::any_of(attachments, &Attachment::holds);
}

}  // namespace exmat::runtime
