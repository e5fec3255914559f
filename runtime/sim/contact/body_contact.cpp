#include "runtime/sim/contact/body_contact.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace exmat::runtime {
namespace {

/// Of the last evaluation, the vertex from y [m].
Eigen::Vector3d place_of(const BodyPose& a, const BodyPose& b, const BodyCandidate& candidate) {
  return a.position + candidate.arm - b.position - candidate.surface_arm;
}

}  // namespace

void BodyContact::evaluate(const ContactSet& set, const BodyPose& a, const BodyPose& b, double way,
                           BodyCandidates& candidates, ContactSums& sums_a, ContactSums& sums_b) const noexcept {
  for (std::size_t i = 0; i < candidates.all.size(); ++i) {
    BodyCandidate& candidate = candidates.all[i];
    if (candidate.clearance > way) {
      leave_untouched(candidate);
      continue;
    }
    candidate.arm = set.world_arm(candidate.vertex, a);
    candidate.surface_arm = candidates.surface_arm(i, b);
    const Eigen::Vector3d place = place_of(a, b, candidate);
    const double gap = candidate.normal.dot(place);
    const double potential = evaluate_contact(gap, candidate.normal, place, candidate);
    if (!candidate.is_loaded()) continue;
    if (candidate.normal_force > 0) {
      ++sums_a.touching;
      ++sums_b.touching;
      sums_a.stiffness += candidate.normal_stiffness();
      sums_b.stiffness += candidate.normal_stiffness();
    }
    sums_a.force += candidate.force;
    sums_a.torque += candidate.arm.cross(candidate.force);
    const Eigen::Vector3d force_a = a.rotation.transpose() * candidate.force;
    sums_a.generalised += set.basis_rows(candidate.vertex).transpose().lazyProduct(force_a);
    sums_a.potential += potential;
    sums_b.force -= candidate.force;
    sums_b.torque -= candidate.surface_arm.cross(candidate.force);
    const Eigen::Vector3d force_b = b.rotation.transpose() * candidate.force;
    sums_b.generalised -= candidates.rows(i).transpose().lazyProduct(force_b);
  }
}

void BodyContact::set_clearances(const BodyPose& a, const BodyPose& b, BodyCandidates& candidates) const noexcept {
  for (BodyCandidate& candidate : candidates.all)
    candidate.clearance = clearance_of(candidate, place_of(a, b, candidate));
}

double BodyContact::potential(const ContactSet& set, const BodyPose& a, const BodyPose& b, double way,
                              const BodyCandidates& candidates) const noexcept {
  double sum = 0;
  for (std::size_t i = 0; i < candidates.all.size(); ++i) {
    const BodyCandidate& candidate = candidates.all[i];
    if (candidate.clearance > way) continue;
    const Eigen::Vector3d place =
        a.position + set.world_arm(candidate.vertex, a) - b.position - candidates.surface_arm(i, b);
    sum += contact_potential(candidate, candidate.normal.dot(place), place);
  }
  return sum;
}

void BodyContact::refresh_friction(BodyCandidates& candidates, FrictionChange& change) const noexcept {
  for (BodyCandidate& candidate : candidates.all) change.refresh(law_.friction, candidate);
}

Eigen::Index BodyContact::stiffness_columns(const ContactSet& set, int rigid_a, int rigid_b, const BodyPose& a,
                                            const BodyPose& b, const BodyCandidates& candidates,
                                            Eigen::MatrixXd& columns_a, Eigen::MatrixXd& columns_b) {
  Eigen::Index needed = 0;  // most candidates touch nothing
  for (const BodyCandidate& candidate : candidates.all) needed += candidate.is_loaded() ? 3 : 0;
  const auto make_room = [needed](Eigen::Index rows, Eigen::MatrixXd& columns) {
    if (columns.rows() != rows || columns.cols() < needed) columns.resize(rows, 2 * needed);
  };
  make_room(rigid_a + a.q.size(), columns_a);
  make_room(rigid_b + b.q.size(), columns_b);
  Eigen::Index used = 0;
  for (std::size_t i = 0; i < candidates.all.size(); ++i) {
    const BodyCandidate& candidate = candidates.all[i];
    if (!candidate.is_loaded()) continue;
    const StiffnessFactors factors(candidate);
    for (int k = 0; k < factors.count; ++k) {
      const Eigen::Vector3d direction = factors.columns.col(k);
      auto column_a = columns_a.col(used);
      auto column_b = columns_b.col(used);
      ++used;
      if (rigid_a > 0) column_a.head<6>() << direction, candidate.arm.cross(direction);
      if (rigid_b > 0) column_b.head<6>() << direction, candidate.surface_arm.cross(direction);
      const Eigen::Vector3d in_a = a.rotation.transpose() * direction, in_b = b.rotation.transpose() * direction;
      column_a.tail(a.q.size()) = set.basis_rows(candidate.vertex).transpose().lazyProduct(in_a);
      column_b.tail(b.q.size()) = candidates.rows(i).transpose().lazyProduct(in_b);
    }
  }
  return used;
}

void BodyContact::commit(const BodyPose& a, const BodyPose& b, const BodyCandidates& candidates,
                         std::vector<HeldBodyContact>& held) const {
  held.clear();
  for (const BodyCandidate& candidate : candidates.all) {
    if (candidate.gap >= 0 && candidate.normal_force <= 0) continue;
    HeldBodyContact& contact = held.emplace_back();
    contact.vertex = candidate.vertex;
    contact.gap = std::min(0.0, candidate.gap);
    contact.normal_force = candidate.normal_force;
    contact.normal = b.rotation.transpose() * candidate.normal;
    const Eigen::Vector3d place = place_of(a, b, candidate);
    if (candidate.normal_force > 0)
      contact.stretch = b.rotation.transpose() * held_stretch(law_.friction, place, candidate);
  }
}

}  // namespace exmat::runtime
