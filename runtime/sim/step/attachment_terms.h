#pragma once

#include <Eigen/Core>
#include <span>

#include "runtime/sim/contact/contact.h"
#include "runtime/sim/frame/body_frame.h"
#include "runtime/sim/solver/conditions.h"
#include "runtime/sim/step/attachment.h"

namespace exmat::runtime {

/// Scratch of the steps of a body in its modes that a host holds, with the conditions of all its attachments.
struct AttachmentWorkspace : Conditions {
  AttachmentWorkspace() = default;
  AttachmentWorkspace(std::span<const Attachment> attachments, Eigen::Index modes, Eigen::Index unknowns);

  /// True if it has the size for steps with these.
  bool fits(std::span<const Attachment> attachments) const noexcept;

  // All unknowns and conditions are one block.
  Eigen::MatrixXd& gradients() noexcept { return blocks.front().gradients; }
  Eigen::MatrixXd& directions() noexcept { return blocks.front().directions; }
  const Eigen::MatrixXd& gradients() const noexcept { return blocks.front().gradients; }
  const Eigen::MatrixXd& directions() const noexcept { return blocks.front().directions; }

  ContactSums sums;          ///< total of all attachments on the body, at the last evaluation
  Eigen::Matrix3Xd forces;   ///< one per attachment, on the body at its mean, world [N]
  Eigen::Matrix3Xd torques;  ///< likewise beside that [N m]
};

/// Coefficients of a rate in the integrator of a step.
struct StepRate {
  double velocity_factor;  ///< c_v [1/s]
  double time_step;        ///< [s]
};

/// Mean of the vertices, world [m].
Eigen::Vector3d mean_of(const Attachment& attachment, const BodyPose& pose) noexcept;

/// A patch is where its mean is, and turned by the rotation that fits it best since it was attached.
struct PatchPlace {
  Eigen::Vector3d arm;       ///< mean from the body's position, world [m]
  Eigen::Matrix3d rotation;  ///< world; of a patch without one that of the body's frame
  Eigen::Matrix3Xd turn;     ///< 3 x r: how it turns about world axes by q, beside the body
};

/// Finds that of a patch with rows of its rotation, or of its mean alone, whose rotation is the body's then.
void place_patch(const ReducedPatch& patch, const BodyPose& pose, PatchPlace& place) noexcept;

// Springs: k/2 |m - a|^2 + c c_v/2 |m - m_v - (a - a_before) / (dt c_v)|^2 of the mean m and the anchor a.

/// Sums and forces of all springs at a pose.
void evaluate_springs(std::span<const Attachment> attachments, const StepRate& rate, const BodyPose& pose,
                      AttachmentWorkspace& workspace) noexcept;
/// Their potential alone [J].
double spring_potential(std::span<const Attachment> attachments, const StepRate& rate, const BodyPose& pose) noexcept;
/// Adds their stiffness to the lower triangle, as ContactSet::add_stiffness(), or of the reduced coordinates alone.
void add_spring_stiffness(std::span<const Attachment> attachments, const StepRate& rate, const BodyPose& pose,
                          Eigen::MatrixXd& stiffness) noexcept;

// Conditions: of a ball m - a = 0; of a fixed patch also sum_k s_k (Q p_k) x x_k = 0 about its axes, over the patch's
// square, which the rotation Q that fits the patch best fulfils. Those of what broke are 0 = 0.

/// C and J^T at a pose of the unknowns x; `frame` turns what turns about world axes into unknowns.
void set_conditions(std::span<const Attachment> attachments, const BodyFrame& frame, const Eigen::VectorXd& x,
                    const BodyPose& pose, AttachmentWorkspace& workspace) noexcept;
/// Adds forces and torques of the multipliers to the sums, but for the generalised ones.
void add_condition_forces(std::span<const Attachment> attachments, const BodyPose& pose,
                          AttachmentWorkspace& workspace) noexcept;

/// After a step that ends at this pose: loads on the frames, what breaks, and what the next step has to know. True if
/// anything broke.
bool end_attachments(const BodyPose& pose, const AttachmentWorkspace& workspace,
                     std::span<Attachment> attachments) noexcept;

/// True if the modes can hold all attachments at once where the body is: their conditions are independent.
bool can_hold(std::span<const Attachment> attachments, const BodyFrame& frame, const BodyPose& pose);

/// The same of a hard attachment between two bodies.
bool can_hold_together(const Attachment& attachment, const BodyFrame& own, const BodyPose& own_pose,
                       const BodyFrame& other, const BodyPose& other_pose);

}  // namespace exmat::runtime
