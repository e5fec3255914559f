#include "runtime/sim/step/attachment_terms.h"

#include <Eigen/LU>

#include "common/core/decompositions.h"
#include "common/elastic/polar_rotation.h"
#include "runtime/sim/frame/spin.h"

namespace exmat::runtime {
namespace {

constexpr double kDependent = 1e-9;  // of the largest condition: what the modes hardly move

/// Stiffness beside that of the spring itself, of the damper.
double stiffness_of(const Attachment& spring, const StepRate& rate) noexcept {
  return spring.stiffness + spring.damping * rate.velocity_factor;
}

bool is_spring(const Attachment& attachment) noexcept {
  return attachment.holds_modes() && attachment.kind == AttachmentKind::kSpring;
}

Eigen::Vector3d arm_of(const Attachment& attachment, const BodyPose& pose) noexcept {
  const Eigen::Vector3d own = attachment.patch.rest.head<3>() + attachment.patch.rows.topRows<3>().lazyProduct(pose.q);
  return pose.rotation * own;
}

struct Spring {
  Eigen::Vector3d arm, stretch, rate;
};

Spring spring_at(const Attachment& attachment, const StepRate& rate, const BodyPose& pose) noexcept {
  const double c_v = rate.velocity_factor;
  const bool second_order = c_v * rate.time_step > 1.25;
  Spring spring;
  spring.arm = arm_of(attachment, pose);
  const Eigen::Vector3d mean = pose.position + spring.arm, anchor = attachment.anchor();
  spring.stretch = mean - anchor;
  const Eigen::Vector3d centre =
      second_order ? Eigen::Vector3d((4 * attachment.mean - attachment.mean_before) / 3) : attachment.mean;
  spring.rate = mean - centre - (anchor - attachment.anchor_before()) / (rate.time_step * c_v);
  return spring;
}

double potential_of(const Attachment& attachment, const StepRate& rate, const Spring& spring) noexcept {
  return 0.5 * (attachment.stiffness * spring.stretch.squaredNorm() +
                attachment.damping * rate.velocity_factor * spring.rate.squaredNorm());
}

/// sum_k s_k p_k y_k^T.
Eigen::Matrix3d second_moment(const ReducedPatch& patch, const Eigen::VectorXd& q) noexcept {
  const Eigen::Matrix<double, 9, 1> rows = patch.rest.tail<9>() + patch.rows.bottomRows<9>().lazyProduct(q);
  return Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(rows.data());
}

Eigen::Index conditions_of(std::span<const Attachment> attachments) noexcept {
  Eigen::Index count = 0;
  for (const Attachment& attachment : attachments) count += attachment.conditions();
  return count;
}

/// Calls use(attachment, its number, its first condition).
template <typename Use>
void for_conditions(std::span<const Attachment> attachments, const Use& use) {
  Eigen::Index first = 0, number = 0;
  for (const Attachment& attachment : attachments) {
    if (attachment.conditions() > 0 && attachment.holds()) use(attachment, number, first);
    first += attachment.conditions();
    ++number;
  }
}

}  // namespace

AttachmentWorkspace::AttachmentWorkspace(std::span<const Attachment> attachments, Eigen::Index modes,
                                         Eigen::Index unknowns) {
  const Eigen::Index count = conditions_of(attachments);
  sums.set_zero(modes);
  forces.setZero(3, std::ssize(attachments));
  torques = forces;
  resize(count);
  blocks.resize(1);
  gradients().setZero(unknowns, count);
  directions() = gradients();
}

bool AttachmentWorkspace::fits(std::span<const Attachment> attachments) const noexcept {
  return forces.cols() == std::ssize(attachments) && conditions() == conditions_of(attachments);
}

Eigen::Vector3d mean_of(const Attachment& attachment, const BodyPose& pose) noexcept {
  return pose.position + arm_of(attachment, pose);
}

// With N = sum_k s_k y_k p_k^T = R S over the patch's square, S symmetric, R turns by R w where N changes by dN: w is
// (tr S I - S)^-1 times the axial vector of R^T dN.
void place_patch(const ReducedPatch& patch, const BodyPose& pose, PatchPlace& place) noexcept {
  const Eigen::Index modes = pose.q.size();
  place.arm = pose.rotation * (patch.rest.head<3>() + patch.rows.topRows<3>().lazyProduct(pose.q));
  place.rotation = pose.rotation;
  place.turn.setZero(3, modes);
  if (patch.axes.cols() < 3) return;
  const Eigen::Matrix3d moment = second_moment(patch, pose.q).transpose() / patch.square;
  const Eigen::Matrix3d own = nearest_rotation(moment), stretch = own.transpose() * moment;
  const Eigen::Matrix3d symmetric = 0.5 * (stretch + stretch.transpose());
  place.rotation = pose.rotation * own;
  const Eigen::Matrix3d by_axial =
      place.rotation * (symmetric.trace() * Eigen::Matrix3d::Identity() - symmetric).inverse() / patch.square;
  for (Eigen::Index j = 0; j < modes; ++j) {
    const Eigen::Matrix<double, 9, 1> rows = patch.rows.col(j).tail<9>();
    const Eigen::Matrix3d change = own.transpose() * Eigen::Map<const Eigen::Matrix3d>(rows.data());
    place.turn.col(j) = by_axial * Eigen::Vector3d(change(2, 1) - change(1, 2), change(0, 2) - change(2, 0),
                                                   change(1, 0) - change(0, 1));
  }
}

void evaluate_springs(std::span<const Attachment> attachments, const StepRate& rate, const BodyPose& pose,
                      AttachmentWorkspace& workspace) noexcept {
  ContactSums& sums = workspace.sums;
  sums.set_zero(pose.q.size());
  Eigen::Index number = -1;
  for (const Attachment& attachment : attachments) {
    ++number;
    if (!is_spring(attachment)) continue;
    const Spring spring = spring_at(attachment, rate, pose);
    const Eigen::Vector3d force =
        -attachment.stiffness * spring.stretch - attachment.damping * rate.velocity_factor * spring.rate;
    workspace.forces.col(number) = force;
    sums.force += force;
    sums.torque += spring.arm.cross(force);
    const Eigen::Vector3d own = pose.rotation.transpose() * force;
    sums.generalised += attachment.patch.rows.topRows<3>().transpose().lazyProduct(own);
    sums.potential += potential_of(attachment, rate, spring);
    sums.stiffness += stiffness_of(attachment, rate);
  }
}

double spring_potential(std::span<const Attachment> attachments, const StepRate& rate, const BodyPose& pose) noexcept {
  double sum = 0;
  for (const Attachment& attachment : attachments)
    if (is_spring(attachment)) sum += potential_of(attachment, rate, spring_at(attachment, rate, pose));
  return sum;
}

void add_spring_stiffness(std::span<const Attachment> attachments, const StepRate& rate, const BodyPose& pose,
                          Eigen::MatrixXd& stiffness) noexcept {
  const Eigen::Index rigid = stiffness.rows() - pose.q.size();
  for (const Attachment& attachment : attachments) {
    if (!is_spring(attachment)) continue;
    const double own = stiffness_of(attachment, rate);
    const auto rows = attachment.patch.rows.topRows<3>();
    stiffness.bottomRightCorner(pose.q.size(), pose.q.size()).triangularView<Eigen::Lower>() +=
        own * rows.transpose().lazyProduct(rows);
    if (rigid == 0) continue;
    const Eigen::Matrix3d turn = cross_matrix(arm_of(attachment, pose));  // the transpose of what the mean turns by
    stiffness.topLeftCorner<3, 3>().diagonal().array() += own;
    stiffness.block<3, 3>(3, 0) += own * turn;
    stiffness.block<3, 3>(3, 3).triangularView<Eigen::Lower>() += own * turn * turn.transpose();
    const Eigen::Matrix3d back = pose.rotation.transpose();
    stiffness.block(6, 0, pose.q.size(), 3) += own * rows.transpose().lazyProduct(back);
    const Eigen::Matrix3d turned = back * turn.transpose();
    stiffness.block(6, 3, pose.q.size(), 3) += own * rows.transpose().lazyProduct(turned);
  }
}

// With G = Q^T R and F = (sum_k s_k p_k y_k^T) G^T, sum_k s_k p_k x (G y_k) is the axial vector of F, and a turn by t
// in the host's frame changes it by (tr F I - F^T) t.
void set_conditions(std::span<const Attachment> attachments, const BodyFrame& frame, const Eigen::VectorXd& x,
                    const BodyPose& pose, AttachmentWorkspace& workspace) noexcept {
  const Eigen::Index modes = pose.q.size(), rigid = x.size() - modes;
  workspace.violation.setZero();
  workspace.gradients().setZero();
  const auto set = [&](const Attachment& attachment, Eigen::Index, Eigen::Index first) {
    const ReducedPatch& patch = attachment.patch;
    const Eigen::Vector3d arm = arm_of(attachment, pose);
    workspace.violation.segment<3>(first) = pose.position + arm - attachment.anchor();
    auto gradients = workspace.gradients().middleCols<3>(first);
    if (rigid > 0) {
      gradients.topRows<3>().setIdentity();
      gradients.middleRows<3>(3) = cross_matrix(arm);
    }
    const Eigen::Matrix3d back = pose.rotation.transpose();
    gradients.bottomRows(modes) = patch.rows.topRows<3>().transpose().lazyProduct(back);
    if (patch.axes.cols() == 0) return;
    const Eigen::Matrix3d G = attachment.rotation.transpose() * pose.rotation;
    const Eigen::Matrix3d F = second_moment(patch, pose.q) * G.transpose();
    const Eigen::Vector3d axial(F(1, 2) - F(2, 1), F(2, 0) - F(0, 2), F(0, 1) - F(1, 0));
    const Eigen::Matrix3d turn = attachment.rotation * (F.trace() * Eigen::Matrix3d::Identity() - F);
    for (Eigen::Index k = 0; k < patch.axes.cols(); ++k) {
      const Eigen::Vector3d axis = patch.axes.col(k) / patch.square;
      workspace.violation[first + 3 + k] = axis.dot(axial);
      auto gradient = workspace.gradients().col(first + 3 + k);
      if (rigid > 0) gradient.segment<3>(3) = turn * axis;
      const Eigen::Matrix<double, 3, 3, Eigen::RowMajor> weights = -cross_matrix(axis) * G;
      gradient.tail(modes) = patch.rows.bottomRows<9>().transpose().lazyProduct(
          Eigen::Map<const Eigen::Matrix<double, 9, 1>>(weights.data()));
    }
  };
  for_conditions(attachments, set);
  if (rigid == 0) return;
  const Eigen::Matrix3d to_turn = frame.turn_to_world(x, pose).transpose();
  for (Eigen::Index k = 0; k < workspace.conditions(); ++k) {
    const Eigen::Vector3d turned = to_turn * workspace.gradients().col(k).segment<3>(3);
    workspace.gradients().col(k).segment<3>(3) = turned;
  }
}

void add_condition_forces(std::span<const Attachment> attachments, const BodyPose& pose,
                          AttachmentWorkspace& workspace) noexcept {
  const auto add = [&](const Attachment& attachment, Eigen::Index number, Eigen::Index first) {
    const ReducedPatch& patch = attachment.patch;
    const Eigen::Vector3d force = workspace.multipliers.segment<3>(first);
    Eigen::Vector3d torque = Eigen::Vector3d::Zero();
    if (patch.axes.cols() > 0) {
      const Eigen::Matrix3d G = attachment.rotation.transpose() * pose.rotation;
      const Eigen::Matrix3d F = second_moment(patch, pose.q) * G.transpose();
      const Eigen::Vector3d about =
          patch.axes.lazyProduct(workspace.multipliers.segment(first + 3, patch.axes.cols())) / patch.square;
      torque = attachment.rotation * (F.trace() * about - F * about);
    }
    workspace.forces.col(number) = force;
    workspace.torques.col(number) = torque;
    workspace.sums.force += force;
    workspace.sums.torque += arm_of(attachment, pose).cross(force) + torque;
  };
  for_conditions(attachments, add);
}

bool end_attachments(const BodyPose& pose, const AttachmentWorkspace& workspace,
                     std::span<Attachment> attachments) noexcept {
  bool breaks = false;
  for (std::size_t i = 0; i < attachments.size(); ++i) {
    Attachment& attachment = attachments[i];
    attachment.force.setZero();
    attachment.torque.setZero();
    if (!attachment.holds_modes()) continue;
    const auto number = static_cast<Eigen::Index>(i);
    const Eigen::Vector3d mean = mean_of(attachment, pose);
    const Eigen::Vector3d at = attachment.kind == AttachmentKind::kSpring ? attachment.anchor() : mean;
    attachment.force = -workspace.forces.col(number);
    attachment.torque = (at - attachment.position).cross(attachment.force) - workspace.torques.col(number);
    attachment.mean_before = attachment.mean;
    attachment.mean = mean;
    attachment.rotation_before = attachment.rotation;
    attachment.position_before = attachment.position;
    attachment.broken = attachment.force.norm() > attachment.break_force;
    breaks = breaks || attachment.broken;
  }
  return breaks;
}

bool can_hold(std::span<const Attachment> attachments, const BodyFrame& frame, const BodyPose& pose) {
  const Eigen::Index rigid = frame.rigid_unknowns();
  const Eigen::VectorXd x = Eigen::VectorXd::Zero(rigid + pose.q.size());
  AttachmentWorkspace workspace(attachments, pose.q.size(), x.size());
  if (workspace.conditions() == 0) return true;
  set_conditions(attachments, frame, x, pose, workspace);
  Eigen::Index held = 0;
  for_conditions(attachments, [&](const Attachment& own, Eigen::Index, Eigen::Index) { held += own.conditions(); });
  Eigen::ColPivHouseholderQR<Eigen::MatrixXd> factor(workspace.gradients());
  factor.setThreshold(kDependent);
  return factor.rank() == held;
}

bool can_hold_together(const Attachment& attachment, const BodyFrame& own, const BodyPose& own_pose,
                       const BodyFrame& other, const BodyPose& other_pose) {
  if (attachment.kind == AttachmentKind::kSpring || own.rigid_unknowns() + other.rigid_unknowns() > 0) return true;
  const auto motion = [](const ReducedPatch& patch, const BodyPose& pose) {
    PatchPlace place;
    place_patch(patch, pose, place);
    Eigen::MatrixXd rows(6, pose.q.size());
    rows << pose.rotation * patch.rows.topRows<3>(), place.turn * std::sqrt(patch.square);
    return rows;
  };
  const Eigen::MatrixXd a = motion(attachment.patch, own_pose), b = motion(attachment.other->patch, other_pose);
  const Eigen::Index count = attachment.kind == AttachmentKind::kFixed ? 6 : 3;
  Eigen::MatrixXd all(count, a.cols() + b.cols());
  all << a.topRows(count), b.topRows(count);
  Eigen::ColPivHouseholderQR<Eigen::MatrixXd> factor(all);
  factor.setThreshold(kDependent);
  return factor.rank() == count;
}

}  // namespace exmat::runtime
