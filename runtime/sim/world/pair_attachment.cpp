#include "runtime/sim/world/pair_attachment.h"

#include <Eigen/Geometry>
#include <algorithm>

#include "runtime/sim/frame/spin.h"
#include "runtime/sim/step/contact_step.h"

namespace exmat::runtime {
namespace {

constexpr double kMostReturn = 0.1;  // of the rotation between patches, in a step [rad]
constexpr double kOpposite = 3;      // between rotations that no step brings together [rad]

/// J^T of a point at `arm` and of the patch's rotation, from how the point goes by q [3 x r].
void set_gradients(int rigid, const Eigen::Vector3d& arm, const Eigen::Matrix3Xd& way, const Eigen::Matrix3Xd& turn,
                   double sign, Eigen::MatrixXd& gradients) noexcept {
  gradients.setZero(rigid + way.cols(), 6);
  if (rigid > 0) {
    gradients.topLeftCorner<3, 3>().setIdentity();
    gradients.block<3, 3>(3, 0) = cross_matrix(arm);
    gradients.block<3, 3>(3, 3).setIdentity();
  }
  gradients.bottomLeftCorner(way.cols(), 3) = way.transpose();
  gradients.bottomRightCorner(way.cols(), 3) = turn.transpose();
  gradients *= sign;
}

Eigen::Matrix3Xd way_of(const ReducedPatch& patch, const Placement& body) {
  return body.rotation.lazyProduct(patch.rows.topRows<3>());
}

}  // namespace

/// The patches at two poses, and how far they are from each other.
void PairAttachment::set_places(const BodyPose& own, const BodyPose& other) noexcept {
  place_patch(attachment_->patch, own, own_);
  place_patch(attachment_->other->patch, other, other_);
  other_arm_ = other_.arm + other_.rotation * attachment_->other->offset;
  violation_.head<3>() = own.position + own_.arm - other.position - other_arm_;
  const Eigen::AngleAxisd turn(Eigen::Matrix3d(own_.rotation * other_.rotation.transpose()));
  violation_.tail<3>() = turn.angle() * turn.axis() - open_;
}

void PairAttachment::begin(Attachment& attachment, int side, const WorldBody& first, const WorldBody& second) noexcept {
  attachment_ = &attachment;
  side_ = side;
  rate_ = 1 / first.scene().time_step;
  force_.setZero();
  torque_.setZero();
  const WorldBody &own = side == 0 ? first : second, &other = side == 0 ? second : first;
  open_.setZero();
  set_places(pose_of(own.model, own.state), pose_of(other.model, other.state));
  start_ = violation_.head<3>();
  const double apart = violation_.tail<3>().norm();
  if (apart > kMostReturn) open_ = (1 - kMostReturn / apart) * violation_.tail<3>();
  const bool turns_alike = attachment.kind == AttachmentKind::kFixed && apart < kOpposite;
  conditions_ = is_spring() ? 0 : turns_alike ? 6 : 3;
}

void PairAttachment::loosen(Eigen::Index most) noexcept {
  conditions_ = std::min(conditions_, most);
  force_.setZero();
  torque_.setZero();
}

void PairAttachment::evaluate(const WorldBody& first, const WorldBody& second) noexcept {
  const WorldBody &own = side_ == 0 ? first : second, &other = side_ == 0 ? second : first;
  set_places(own.pose(), other.pose());
  const auto at = static_cast<std::size_t>(side_);
  set_gradients(own.rigid(), own_.arm, way_of(attachment_->patch, own.placement), own_.turn, 1, gradients_[at]);
  const Eigen::Matrix3d held = cross_matrix(other_arm_ - other_.arm);
  const Eigen::Matrix3Xd way = way_of(attachment_->other->patch, other.placement) - held * other_.turn;
  set_gradients(other.rigid(), other_arm_, way, other_.turn, -1, gradients_[1 - at]);
  if (!is_spring()) return;
  const Eigen::Vector3d stretch = violation_.head<3>();
  force_ = -attachment_->stiffness * stretch - attachment_->damping * rate_ * (stretch - start_);
}

double PairAttachment::potential() const noexcept {
  const Eigen::Vector3d stretch = violation_.head<3>();
  return 0.5 * (attachment_->stiffness * stretch.squaredNorm() +
                attachment_->damping * rate_ * (stretch - start_).squaredNorm());
}

double PairAttachment::potential(const WorldBody& first, const WorldBody& second) noexcept {
  if (!is_spring()) return 0;
  evaluate(first, second);
  return potential();
}

double PairAttachment::spring_energy() const noexcept {
  return is_spring() ? 0.5 * attachment_->stiffness * violation_.head<3>().squaredNorm() : 0;
}

double spring_energy_of(const Attachment& attachment, const BodyPose& own, const BodyPose& other) noexcept {
  if (attachment.kind != AttachmentKind::kSpring) return 0;
  PatchPlace at;
  place_patch(attachment.other->patch, other, at);
  const Eigen::Vector3d held = other.position + at.arm + at.rotation * attachment.other->offset;
  return 0.5 * attachment.stiffness * (mean_of(attachment, own) - held).squaredNorm();
}

void PairAttachment::add_spring(int side, ContactSums& sums) const noexcept {
  if (!is_spring()) return;
  add_load(side, sums);
  const Eigen::Index modes = sums.generalised.size();
  sums.generalised += gradients(side).bottomLeftCorner(modes, 3).lazyProduct(force_);
  sums.stiffness += stiffness();
  if (side == side_) sums.potential += potential();
}

void PairAttachment::set_multipliers(const Eigen::Ref<const Eigen::VectorXd>& multipliers) noexcept {
  force_ = multipliers.head<3>();
  if (multipliers.size() > 3) torque_ = multipliers.tail<3>();
}

void PairAttachment::add_load(int side, ContactSums& sums) const noexcept {
  sums.force += sign(side) * force_;
  sums.torque += sign(side) * (arm(side).cross(force_) + torque_);
}

void PairAttachment::add_force(const Eigen::Vector3d& force, ContactSums& first, ContactSums& second) noexcept {
  force_ += force;
  for (const int side : {0, 1}) {
    ContactSums& sums = side == 0 ? first : second;
    sums.force += sign(side) * force;
    sums.torque += sign(side) * arm(side).cross(force);
  }
}

/// `first` and `second`: where the two bodies began the step.
Eigen::Vector3d PairAttachment::torque_correction(const Eigen::Vector3d& first,
                                                  const Eigen::Vector3d& second) const noexcept {
  const Eigen::Vector3d between = side_ == 0 ? first - second : second - first;
  return -0.5 * (between + own_.arm - other_arm_).cross(force_);
}

void PairAttachment::end(const WorldBody& first, const WorldBody& second) noexcept {
  const WorldBody& other = side_ == 0 ? second : first;
  attachment_->force = -force_;
  attachment_->torque = -torque_;
  attachment_->rotation = other_.rotation;
  attachment_->position = other.model.frame->placement(other.state.frame).position + other_arm_;
  attachment_->broken = force_.norm() > attachment_->break_force;
}

}  // namespace exmat::runtime
