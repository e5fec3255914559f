#pragma once

#include <Eigen/Core>
#include <Eigen/LU>
#include <span>

#include "runtime/sim/contact/contact.h"
#include "runtime/sim/frame/body_frame.h"
#include "runtime/sim/step/attachment.h"

namespace exmat::runtime {

/// Scratch of the steps of a body in its modes that a host holds: n unknowns, c conditions of all its attachments.
struct AttachmentWorkspace {
  AttachmentWorkspace() = default;
  AttachmentWorkspace(std::span<const Attachment> attachments, Eigen::Index modes, Eigen::Index unknowns);

  Eigen::Index conditions() const noexcept { return violation.size(); }
  /// True if it has the size for steps with these.
  bool fits(std::span<const Attachment> attachments) const noexcept;

  ContactSums sums;                                ///< total of all attachments on the body, at the last evaluation
  Eigen::Matrix3Xd forces;                         ///< one per attachment, on the body at its mean, world [N]
  Eigen::Matrix3Xd torques;                        ///< likewise beside that [N m]
  Eigen::VectorXd violation, multipliers, change;  ///< c: C, lambda, scratch
  Eigen::MatrixXd gradients, directions;           ///< n x c: J^T, A^-1 J^T
  Eigen::MatrixXd product, inverse;                ///< c x c: J (A^-1 J^T), and its inverse
  Eigen::PartialPivLU<Eigen::MatrixXd> factor;     ///< LU factors of product

  /// product, factor and inverse of gradients and directions; conditions of what broke stay 0 = 0.
  void invert() noexcept;
};

/// Coefficients of a rate in the integrator of a step.
struct StepRate {
  double velocity_factor;  ///< c_v [1/s]
  double time_step;        ///< [s]
};

/// Mean of the vertices, world [m].
Eigen::Vector3d mean_of(const Attachment& attachment, const BodyPose& pose) noexcept;

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

}  // namespace exmat::runtime
