#pragma once

#include <Eigen/Core>
#include <array>

#include "runtime/sim/step/attachment.h"
#include "runtime/sim/world/world_body.h"

namespace exmat::runtime {

/// An attachment between two bodies of a pair, at their iterates. x is the mean of the patch of the body that has it, y
/// the point that holds x in the other's patch, as that patch goes and turns. A spring pulls them together,
///   k/2 |x - y|^2 + c/(2 dt) |(x - y) - (x - y)_n|^2;
/// the others are conditions x - y = 0 and, of a fixed one, that the two patches turn alike. A patch that is pressed
/// flat or inside out has turned by half a turn at once: rotations that are far apart where a step begins come together
/// over several steps, and are let go while they are opposite. What acts on one body at x acts on the other at y with
/// the opposite sign. docs/step_in_detail.md, "Attachments".
class PairAttachment {
 public:
  /// The attachment is one of the body of this side; the bodies stand where a step begins.
  void begin(Attachment& attachment, int side, const WorldBody& first, const WorldBody& second) noexcept;

  bool is_spring() const noexcept { return attachment_->kind == AttachmentKind::kSpring; }
  /// As many of its conditions hold in this step: the 3 on places come first, then the 3 on rotations.
  Eigen::Index conditions() const noexcept { return conditions_; }
  /// Lets no more than the first `most` hold.
  void loosen(Eigen::Index most) noexcept;

  // At the iterates of the bodies.

  void evaluate(const WorldBody& first, const WorldBody& second) noexcept;
  /// x - y [m], then the rotation vector of the own patch against the other's, less what this step leaves open.
  const Eigen::Matrix<double, 6, 1>& violation() const noexcept { return violation_; }
  /// Their derivative by a side's unknowns, transposed [unknowns x 6], with rotations about world axes.
  const Eigen::MatrixXd& gradients(int side) const noexcept { return gradients_[static_cast<std::size_t>(side)]; }
  double potential(const WorldBody& first, const WorldBody& second) noexcept;

  // At the last evaluation.

  /// Adds what the spring does to a side's body.
  void add_spring(int side, ContactSums& sums) const noexcept;
  double stiffness() const noexcept { return attachment_->stiffness + attachment_->damping * rate_; }
  double spring_energy() const noexcept;  ///< without the damper [J]
  /// Multipliers of the conditions as the load of the attachment.
  void set_multipliers(const Eigen::Ref<const Eigen::VectorXd>& multipliers) noexcept;
  double sign(int side) const noexcept { return side == side_ ? 1 : -1; }  ///< of the force on a side's body
  /// Adds to the force of the attachment, and to the load on either body.
  void add_force(const Eigen::Vector3d& force, ContactSums& first, ContactSums& second) noexcept;
  /// Adds force and torque of the conditions on a side's body.
  void add_load(int side, ContactSums& sums) const noexcept;
  /// As PairContact::torque_correction().
  Eigen::Vector3d torque_correction(const Eigen::Vector3d& first, const Eigen::Vector3d& second) const noexcept;

  /// After the step: the load on the other body and where that has the patch; too large a load breaks the attachment.
  void end(const WorldBody& first, const WorldBody& second) noexcept;

 private:
  void set_places(const BodyPose& own, const BodyPose& other) noexcept;
  double potential() const noexcept;
  const Eigen::Vector3d& arm(int side) const noexcept { return side == side_ ? own_.arm : other_arm_; }

  Attachment* attachment_ = nullptr;
  int side_ = 0;
  Eigen::Index conditions_ = 0;
  double rate_ = 0;                                  // 1 / dt [1/s]
  Eigen::Vector3d start_ = Eigen::Vector3d::Zero();  // x - y where the step begins
  Eigen::Vector3d open_ = Eigen::Vector3d::Zero();   // rotation that this step leaves open
  PatchPlace own_, other_;
  Eigen::Vector3d other_arm_ = Eigen::Vector3d::Zero();  // y from the other body's position
  Eigen::Matrix<double, 6, 1> violation_;
  std::array<Eigen::MatrixXd, 2> gradients_;
  Eigen::Vector3d force_ = Eigen::Vector3d::Zero();   // on the body that has it, at x [N]
  Eigen::Vector3d torque_ = Eigen::Vector3d::Zero();  // on it beside that [N m]
};

/// Energy of the spring of an attachment between bodies at these poses, 0 of a hard one [J].
double spring_energy_of(const Attachment& attachment, const BodyPose& own, const BodyPose& other) noexcept;

}  // namespace exmat::runtime
