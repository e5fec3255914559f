#include "runtime/sim/world/pair_contact.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "runtime/sim/step/contact_step.h"

namespace exmat::runtime {
namespace {

/// A body where the step begins.
TouchingBody touching(const WorldBody& body) {
  return {body.contact(), *body.touching, pose_of(body.model, body.state),
          BodyVelocity{body.model.frame->velocity(body.state.frame), body.state.v}};
}

double energy_of_spring(const ContactCandidate& candidate, double depth) {
  return depth > 0 ? 0.5 * candidate.stiffness * depth * depth : 0;
}

/// Columns about world axes become those of the unknowns.
void to_unknowns(const WorldBody& body, const Eigen::VectorXd& x, Eigen::Index used, Eigen::MatrixXd& columns) {
  if (body.rigid() == 0) return;
  const Eigen::Matrix3d turn = body.model.frame->turn_to_world(x, body.placement).transpose();
  for (Eigen::Index i = 0; i < used; ++i) {
    const Eigen::Vector3d turned = turn * columns.block<3, 1>(3, i);
    columns.block<3, 1>(3, i) = turned;
  }
}

}  // namespace

void PairContact::reset(int first, int second, const HeldPair* held) {
  bodies_ = {first, second};
  held_ = held;
  has_first_ = is_abandoned_ = false;
  account_ = start_energy_ = 0;
  for (BodyCandidates& candidates : candidates_) candidates.all.clear();
}

void PairContact::gather(const ContactLaw& law, int side, const WorldBody& own, WorldBody& other, double margin) {
  static const std::vector<HeldBodyContact> none;
  half_ = law.half();
  const auto at = static_cast<std::size_t>(side);
  const std::vector<HeldBodyContact>& held = held_ != nullptr ? held_->held[at] : none;
  const BodyContact contact(half_);
  const CandidateSearch search{own.scene.time_step, margin, own.anew || other.anew, held, other.shape, near_[at]};
  if (is_own())
    contact.gather_own(touching(own), search, candidates_[at]);
  else
    contact.gather(touching(own), touching(other), search, candidates_[at]);
}

void PairContact::begin_account() noexcept {
  const auto depth_of = [](const BodyCandidate& candidate) {
    return -candidate.normal.dot(candidate.carried) - candidate.overlap;
  };
  double energy = 0, released = 0;
  for (const BodyCandidates& candidates : candidates_)
    for (const BodyCandidate& candidate : candidates.all) {
      const double depth = depth_of(candidate), own = energy_of_spring(candidate, depth);
      energy += own;
      released += own - energy_of_spring(candidate, depth - candidate.released);
    }
  const bool is_known = held_ == nullptr || std::isfinite(held_->account);
  account_ = !is_known ? energy : released + (held_ != nullptr ? held_->account : 0);
  start_energy_ = std::min(energy, account_);
  if (energy <= account_) return;
  for (BodyCandidates& candidates : candidates_)
    for (BodyCandidate& candidate : candidates.all)
      if (depth_of(candidate) > 0) candidate.stiffness *= account_ / energy;
}

/// What contacts lose is theirs to give back: of springs, by friction and damping, and what backward Euler takes from
/// the motion of the two against each other, 1/2 dt F . (u_1 - u_0).
void PairContact::end_account(const WorldBody& first, const WorldBody& second, const Eigen::Vector3d& parted,
                              bool converged) noexcept {
  double given = 0;
  Eigen::Vector3d force = Eigen::Vector3d::Zero();  // on the first
  for (std::size_t at = 0; at < 2; ++at) {
    const WorldBody& own = at == 0 ? first : second;
    const WorldBody& other = at == 0 ? second : first;
    for (const BodyCandidate& candidate : candidates_[at].all) {
      if (!candidate.is_loaded()) continue;
      const Eigen::Vector3d place =
          own.placement.position + candidate.arm - other.placement.position - candidate.surface_arm;
      given += candidate.force.dot(place - candidate.carried);
      force += (at == 0 ? 1 : -1) * candidate.force;
    }
  }
  if (converged)
    account_ += 0.5 * first.scene.time_step * force.dot(parted) - given;
  else
    account_ += spring_energy() - start_energy_;
  account_ = std::isfinite(account_) ? std::max(0.0, account_) : 0;
}

double PairContact::spring_energy() const noexcept {
  double sum = 0;
  for (const BodyCandidates& candidates : candidates_)
    for (const BodyCandidate& candidate : candidates.all)
      sum += energy_of_spring(candidate, -candidate.gap - candidate.overlap);
  return sum;
}

double PairContact::way_since_first(const WorldBody& first, const WorldBody& second) const noexcept {
  return first.way_bound(first_[0], first_q_[0]) + second.way_bound(first_[1], first_q_[1]);
}

void PairContact::evaluate(const WorldBody& first, const WorldBody& second) {
  sums_[0].set_zero(first.state.q.size());
  sums_[1].set_zero(second.state.q.size());
  const bool is_first = !has_first_;
  if (is_first) {
    has_first_ = true;
    first_ = {first.placement, second.placement};
    first_q_ = {first.near().q, second.near().q};
  }
  const double way = is_first ? 0 : way_since_first(first, second);
  const BodyContact contact(half_);
  contact.evaluate(first.contact(), first.pose(), second.pose(), way, candidates_[0], sums_[0],
                   sums_[is_own() ? 0 : 1]);
  contact.evaluate(second.contact(), second.pose(), first.pose(), way, candidates_[1], sums_[1], sums_[0]);
  if (!is_first) return;
  contact.set_clearances(first.pose(), second.pose(), candidates_[0]);
  contact.set_clearances(second.pose(), first.pose(), candidates_[1]);
}

double PairContact::potential(const WorldBody& first, const WorldBody& second) const noexcept {
  const BodyContact contact(half_);
  const double way = way_since_first(first, second);
  return contact.potential(first.contact(), first.pose(), second.pose(), way, candidates_[0]) +
         contact.potential(second.contact(), second.pose(), first.pose(), way, candidates_[1]);
}

void PairContact::set_columns(const WorldBody& first, const WorldBody& second) {
  for (std::size_t at = 0; at < 2; ++at) {
    const WorldBody& own = at == 0 ? first : second;
    const WorldBody& other = at == 0 ? second : first;
    used_[at] = BodyContact::stiffness_columns(own.contact(), own.rigid(), other.rigid(), own.pose(), other.pose(),
                                               candidates_[at], own_columns_[at], other_columns_[at]);
  }
  if (is_own()) own_columns_[0].leftCols(used_[0]) -= other_columns_[0].leftCols(used_[0]);
}

void PairContact::add_stiffness(int side, Eigen::MatrixXd& stiffness) const {
  const auto at = static_cast<std::size_t>(side);
  auto lower = stiffness.selfadjointView<Eigen::Lower>();
  if (used_[at] > 0) lower.rankUpdate(own_columns_[at].leftCols(used_[at]));
  if (used_[1 - at] > 0 && !is_own()) lower.rankUpdate(other_columns_[1 - at].leftCols(used_[1 - at]));
}

void PairContact::set_coupling(const WorldBody& first, const Eigen::VectorXd& x_first, const WorldBody& second,
                               const Eigen::VectorXd& x_second) {
  if (is_own()) return;
  coupling_.setZero(first.unknowns(), second.unknowns());
  to_unknowns(first, x_first, used_[0], own_columns_[0]);
  to_unknowns(second, x_second, used_[0], other_columns_[0]);
  to_unknowns(second, x_second, used_[1], own_columns_[1]);
  to_unknowns(first, x_first, used_[1], other_columns_[1]);
  if (used_[0] > 0)
    coupling_.noalias() -= own_columns_[0].leftCols(used_[0]) * other_columns_[0].leftCols(used_[0]).transpose();
  if (used_[1] > 0)
    coupling_.noalias() -= other_columns_[1].leftCols(used_[1]) * own_columns_[1].leftCols(used_[1]).transpose();
}

void PairContact::refresh_friction(FrictionChange& change) noexcept {
  for (BodyCandidates& candidates : candidates_) BodyContact(half_).refresh_friction(candidates, change);
}

Eigen::Vector3d PairContact::torque_correction(const WorldBody& first, const Eigen::Vector3d& way_first,
                                               const WorldBody& second,
                                               const Eigen::Vector3d& way_second) const noexcept {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  if (first.rigid() == 0 || second.rigid() == 0) return sum;
  for (std::size_t at = 0; at < 2; ++at) {
    const WorldBody& own = at == 0 ? first : second;
    const WorldBody& other = at == 0 ? second : first;
    const Eigen::Vector3d own_way = at == 0 ? way_first : way_second, other_way = at == 0 ? way_second : way_first;
    const Eigen::Vector3d between = own.placement.position - other.placement.position - (own_way - other_way);
    for (const BodyCandidate& candidate : candidates_[at].all) {
      const Eigen::Vector3d apart = between + candidate.arm - candidate.surface_arm;
      sum -= (is_own() ? 1 : 0.5) * apart.cross(candidate.force);
    }
  }
  return sum;
}

void PairContact::read_touches(int side, const WorldBody& own, int number, int other,
                               std::vector<BodyTouch>& touches) const {
  for (const BodyCandidate& candidate : candidates_[static_cast<std::size_t>(side)].all)
    if (candidate.normal_force > 0)
      touches.push_back({number, other, own.contact().object_vertex(candidate.vertex), -candidate.gap,
                         own.placement.position + candidate.arm, candidate.normal, candidate.force});
}

void PairContact::commit(const WorldBody& first, const WorldBody& second, HeldPair& held) const {
  if (is_abandoned_) {
    held = held_ != nullptr ? *held_ : HeldPair();
    return;
  }
  held.energy = std::min(spring_energy(), account_);
  held.account = account_;
  const BodyContact contact(half_);
  contact.commit(first.pose(), second.pose(), candidates_[0], held.held[0]);
  contact.commit(second.pose(), first.pose(), candidates_[1], held.held[1]);
}

}  // namespace exmat::runtime
