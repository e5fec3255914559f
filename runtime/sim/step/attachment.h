#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "common/core/arrays.h"
#include "common/model/choices.h"
#include "runtime/sim/frame/motion.h"

namespace exmat::runtime {

/// Patch in the modes. Its moments are rest + rows q, in the frame of the body: the mean of its vertices beyond
/// Placement::origin [m] and, of a fixed one, sum_k s_k p_k y_k^T [m^2] by rows, s the shares, p the places about their
/// mean, y the vertices.
struct ReducedPatch {
  RowMatrix rows;         ///< 3 x r, or 12 x r of a fixed one
  Eigen::VectorXd rest;   ///< 3 or 12
  Eigen::Matrix3Xd axes;  ///< hold its rotation, host's frame: 3; 2 for vertices in a line; 0 for one
  double square = 0;      ///< sum_k s_k |p_k|^2 [m^2]
};

/// The other end of an attachment between two bodies of a world, in their modes.
struct OtherEnd {
  int body = 0;                                      ///< number in the world
  std::vector<std::int32_t> vertices;                ///< of its mesh
  ReducedPatch patch;                                ///< with the rotation, unless its vertices are in a line
  Eigen::Vector3d offset = Eigen::Vector3d::Zero();  ///< of what it holds from its mean, in its own frame [m]
};

/// A patch of a body that a frame holds, which its host moves or a motion, or another patch of the world's bodies: that
/// is its frame then, with its mean and the rotation that fits it best. No two frames hold the same vertex.
struct Attachment {
  std::int64_t id = 0;
  AttachmentKind kind = AttachmentKind::kFixed;
  std::vector<std::int32_t> vertices;                            ///< k, of the mesh, that move
  Eigen::VectorXd shares;                                        ///< [k] of the mean, of sum 1
  Eigen::Matrix3Xd places;                                       ///< [3 x k] of the vertices in the frame [m]
  double stiffness = 0, damping = 0;                             ///< both for a spring [N/m], [N s/m]
  double break_force = std::numeric_limits<double>::infinity();  ///< [N]
  ReducedPatch patch;                                            ///< filled for a body that steps in its modes
  std::shared_ptr<const RigidMotion> motion{};  ///< of the frame, perhaps an obstacle's; null: its host moves it
  std::optional<OtherEnd> other{};              ///< present where another body's patch holds it, in place of a frame

  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();  ///< frame to world, at the end of the next step
  Eigen::Vector3d position = Eigen::Vector3d::Zero();      ///< world [m]
  Eigen::Matrix3d rotation_before = rotation;              ///< likewise at the end of the last step
  Eigen::Vector3d position_before = position;
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();  ///< mean of the vertices, world, at the end of the last step [m]
  Eigen::Vector3d mean_before = mean;              ///< one step earlier; both of a body that steps in its modes

  Eigen::Vector3d force = Eigen::Vector3d::Zero();   ///< on the frame, of the last step [N]
  Eigen::Vector3d torque = Eigen::Vector3d::Zero();  ///< about its origin [N m]
  bool broken = false;                               ///< the force was larger than it bears: it holds no longer

  /// Puts the frame where its motion has it at the ends of a step [s], if it has one.
  void follow(double start, double end) noexcept;

  bool holds() const noexcept { return !broken; }
  /// True if a frame holds the body.
  bool is_framed() const noexcept { return !broken && !other; }
  /// True if a frame holds it and steps in modes see that.
  bool holds_modes() const noexcept { return is_framed() && patch.rows.rows() > 0; }
  /// Conditions on the body by itself in its modes: those of the mean, then those of the rotation about patch.axes.
  Eigen::Index conditions() const noexcept {
    return other || kind == AttachmentKind::kSpring || patch.rows.rows() == 0 ? 0 : 3 + patch.axes.cols();
  }
  Eigen::Vector3d target(Eigen::Index k) const noexcept { return position + rotation * places.col(k); }
  /// Point that holds the mean, world [m].
  Eigen::Vector3d anchor() const noexcept { return position + rotation * (places * shares); }
  Eigen::Vector3d anchor_before() const noexcept { return position_before + rotation_before * (places * shares); }
};

/// True if a frame holds the body.
inline bool is_held(std::span<const Attachment> attachments) noexcept {
  return std::ranges::any_of(attachments, &Attachment::is_framed);
}

/// True if one holds a body that steps in its modes.
inline bool holds_modes(std::span<const Attachment> attachments) noexcept {
  return std::ranges::any_of(attachments, &Attachment::holds_modes);
}

/// Sets shares and places of the vertices, whose masses are these [k], from where they are in the world [3 x k].
void take_hold(const Eigen::VectorXd& masses, const Eigen::Matrix3Xd& here, Attachment& attachment);

/// The patch of vertices at rest at `rest` [k x 3] beyond Placement::origin, with `basis_rows` [3k x r], `shares` and
/// `places` as those of an attachment; `turns`: with its rotation.
ReducedPatch reduce_patch(const VertexArray& rest, const RowMatrix& basis_rows, const Eigen::VectorXd& shares,
                          const Eigen::Matrix3Xd& places, bool turns);

/// After a body was taken out of a world: attachments to it are gone, and bodies after it have a number less.
void forget_body(int body, std::vector<Attachment>& attachments) noexcept;

}  // namespace exmat::runtime
