#include "runtime/sim/world/pair_contact.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>

#include "runtime/sim/step/contact_step.h"

namespace exmat::runtime {
namespace {

constexpr double kOneWay = 0.5;        // of the ways out of what overlaps, by its depth, in the sum of all of them
constexpr double kDeepOverlap = 0.05;  // of a radius

/// Calls work(a, b) with the two bodies at their iterates as contacts see them.
template <class Work>
auto see(const WorldBody& first, const WorldBody& second, const Work& work) {
  const BodyPose first_pose = first.pose(), second_pose = second.pose();
  const auto with_second = [&](const auto& a) {
    if (second.full) return work(a, second.full_side());
    return work(a, ReducedSide{second.contact(), second_pose, second.rigid()});
  };
  if (first.full) return with_second(first.full_side());
  return with_second(ReducedSide{first.contact(), first_pose, first.rigid()});
}

/// The way by which the first body leaves the second, world: the one that their overlaps have, as long as it is no
/// detour. Shallow ones that have none, as of a peg in its hole, are released where they are.
std::optional<Eigen::Vector3d> way_out_of(const HeldPair& pair, const TouchingBody& first, const TouchingBody& second) {
  Eigen::Vector3d way = Eigen::Vector3d::Zero();
  double all = 0, deepest = 0;
  for (std::size_t side = 0; side < 2; ++side)
    for (const HeldBodyContact& contact : pair.held[side]) {
      way += (side == 0 ? contact.overlap : -contact.overlap) *
             ((side == 0 ? second : first).pose.rotation * contact.normal);
      all += contact.overlap;
      deepest = std::max(deepest, contact.overlap);
    }
  if (all == 0) return std::nullopt;
  if (way.norm() > kOneWay * all) return way_out_of(first, second, way.normalized());
  const auto radius = [](const TouchingBody& body) { return body.touching.surface.bound(body.pose.q).radius; };
  if (!(deepest > kDeepOverlap * std::min(radius(first), radius(second)))) return std::nullopt;
  return way_out_of(first, second);
}

/// Columns about world axes become those of the unknowns.
void to_unknowns(const WorldBody& body, const Eigen::VectorXd& x, Eigen::Index used, Eigen::MatrixXd& columns) {
  if (body.rigid() == 0 || body.full) return;
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
  account_ = start_energy_ = released_ = 0;
  attachment_count_ = 0;
  for (BodyCandidates& candidates : candidates_) candidates.all.clear();
}

void PairContact::attach(Attachment& attachment, int side, const WorldBody& first, const WorldBody& second) {
  if (attachment_count_ == attachments_.size()) attachments_.emplace_back();
  attachments_[attachment_count_++].begin(attachment, side, first, second);
}

void PairContact::gather(const ContactLaw& law, int side, const WorldBody& own, WorldBody& other, double margin) {
  static const std::vector<HeldBodyContact> none;
  half_ = law.half();
  if (held_ != nullptr && held_->overlaps()) half_.friction = 0;  // nothing keeps them from leaving each other
  const auto at = static_cast<std::size_t>(side);
  const std::vector<HeldBodyContact>& held = held_ != nullptr ? held_->held[at] : none;
  const BodyContact contact(half_);
  CandidateSearch search{
      own.scene().time_step, margin,   own.state.contacts.first_step || other.state.contacts.first_step, held,
      other.placed_shape(),  near_[at]};
  search.gravity = own.scene().gravity.norm();
  if (is_own()) {
    contact.gather_own(own.touching_body(), search, candidates_[at]);
    if (own.full) own.full->drop_driven(candidates_[at]);
    return;
  }
  const TouchingBody its_own = own.touching_body(), its_other = other.touching_body();
  const bool is_first = side == 0;
  const TouchingBody &first = is_first ? its_own : its_other, &second = is_first ? its_other : its_own;
  if (search.anew)
    search.way_out = way_out_of(first, second);
  else if (held_ != nullptr)
    search.way_out = way_out_of(*held_, first, second);
  if (search.way_out && !is_first) *search.way_out *= -1;
  contact.gather(its_own, its_other, search, candidates_[at]);
}

void PairContact::begin_account() noexcept {
  const auto depth_of = [](const BodyCandidate& candidate) {
    return -candidate.normal.dot(candidate.carried) - candidate.overlap;
  };
  double energy = 0;
  released_ = 0;
  for (const BodyCandidates& candidates : candidates_)
    for (const BodyCandidate& candidate : candidates.all) {
      energy += candidate.spring_energy(depth_of(candidate));
      released_ += candidate.released;
    }
  const bool is_known = held_ == nullptr || std::isfinite(held_->account);
  account_ = !is_known ? energy : released_ + (held_ != nullptr ? held_->account : 0);
  start_energy_ = std::min(energy, account_);
  if (energy <= account_) return;
  for (BodyCandidates& candidates : candidates_)
    for (BodyCandidate& candidate : candidates.all)
      if (depth_of(candidate) > 0) candidate.stiffness *= account_ / energy;
}

/// Contacts may give back their losses: of springs, by friction and damping, and what backward Euler takes from the
/// motion of the two against each other, 1/2 dt F . (u_1 - u_0). What was released and did not push is gone.
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
  if (converged) {
    const double owed = given - std::min(std::max(given, 0.0), released_);  // what was released is given first
    account_ += 0.5 * first.scene().time_step * force.dot(parted) - owed - released_;
  } else {
    account_ += spring_energy() - start_energy_;
  }
  if (released_ > 0) account_ = std::max(account_, spring_energy());
  account_ = std::isfinite(account_) ? std::max(0.0, account_) : 0;
}

double PairContact::spring_energy() const noexcept {
  double sum = 0;
  for (const BodyCandidates& candidates : candidates_)
    for (const BodyCandidate& candidate : candidates.all)
      sum += candidate.spring_energy(-candidate.gap - candidate.overlap);
  return sum;
}

double PairContact::attached_energy() const noexcept {
  double sum = 0;
  for (const PairAttachment& own : attachments()) sum += own.spring_energy();
  return sum;
}

void PairContact::add_springs(int side, ContactSums& sums) const noexcept {
  for (const PairAttachment& own : attachments()) own.add_spring(side, sums);
}

double PairContact::way_since_first(const WorldBody& first, const WorldBody& second) const noexcept {
  if (first.full || second.full) return std::numeric_limits<double>::infinity();
  return first.way_bound(first_[0], first_q_[0]) + second.way_bound(first_[1], first_q_[1]);
}

void PairContact::evaluate(const WorldBody& first, const WorldBody& second) {
  sums_[0].set_zero(first.state.q.size());
  sums_[1].set_zero(second.state.q.size());
  for (PairAttachment& own : attachments())
    if (own.is_spring()) own.evaluate(first, second);
  const bool is_first = !has_first_;
  if (is_first) {
    has_first_ = true;
    first_ = {first.placement, second.placement};
    first_q_ = {first.near().q, second.near().q};
  }
  const double way = is_first ? 0 : way_since_first(first, second);
  const BodyContact contact(half_);
  see(first, second, [&](const auto& a, const auto& b) {
    contact.evaluate(a, b, way, candidates_[0], sums_[0], sums_[is_own() ? 0 : 1]);
    contact.evaluate(b, a, way, candidates_[1], sums_[1], sums_[0]);
  });
  if (!is_first) return;
  contact.set_clearances(first.pose(), second.pose(), candidates_[0]);
  contact.set_clearances(second.pose(), first.pose(), candidates_[1]);
}

double PairContact::potential(const WorldBody& first, const WorldBody& second) noexcept {
  const BodyContact contact(half_);
  const double way = way_since_first(first, second);
  double springs = 0;
  for (PairAttachment& own : attachments()) springs += own.potential(first, second);
  return springs + see(first, second, [&](const auto& a, const auto& b) {
           return contact.potential(a, b, way, candidates_[0]) + contact.potential(b, a, way, candidates_[1]);
         });
}

void PairContact::set_columns(const WorldBody& first, const WorldBody& second) {
  see(first, second, [&](const auto& a, const auto& b) {
    used_[0] = BodyContact::stiffness_columns(a, b, candidates_[0], own_columns_[0], other_columns_[0]);
    used_[1] = BodyContact::stiffness_columns(b, a, candidates_[1], own_columns_[1], other_columns_[1]);
  });
  if (first.full || second.full) set_directions();
  add_spring_columns();
  if (is_own()) own_columns_[0].leftCols(used_[0]) -= other_columns_[0].leftCols(used_[0]);
}

/// Springs of attachments, as if contacts of the first's vertices.
void PairContact::add_spring_columns() {
  for (const PairAttachment& spring : attachments()) {
    if (!spring.is_spring()) continue;
    const double root = std::sqrt(spring.stiffness());
    const auto add = [&](const Eigen::MatrixXd& gradients, double sign, Eigen::MatrixXd& columns) {
      if (columns.cols() < used_[0] + 3) columns.conservativeResize(gradients.rows(), used_[0] + 3);
      columns.middleCols<3>(used_[0]) = sign * root * gradients.leftCols<3>();
    };
    add(spring.gradients(0), 1, own_columns_[0]);
    add(spring.gradients(1), -1, other_columns_[0]);
    used_[0] += 3;
  }
}

/// Those of the columns.
void PairContact::set_directions() {
  for (std::size_t at = 0; at < 2; ++at) {
    directions_[at].clear();
    const std::vector<BodyCandidate>& all = candidates_[at].all;
    for (std::size_t i = 0; i < all.size(); ++i) {
      if (!all[i].is_loaded()) continue;
      const StiffnessFactors factors(all[i]);
      for (int k = 0; k < factors.count; ++k) directions_[at].push_back({factors.columns.col(k), i});
    }
  }
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
  to_unknowns(first, x_first, used_[0], own_columns_[0]);
  to_unknowns(second, x_second, used_[0], other_columns_[0]);
  to_unknowns(second, x_second, used_[1], own_columns_[1]);
  to_unknowns(first, x_first, used_[1], other_columns_[1]);
  coupling_.setZero(own_columns_[0].rows(), own_columns_[1].rows());
  if (coupling_.size() == 0) return;
  if (used_[0] > 0)
    coupling_.noalias() -= own_columns_[0].leftCols(used_[0]) * other_columns_[0].leftCols(used_[0]).transpose();
  if (used_[1] > 0)
    coupling_.noalias() -= other_columns_[1].leftCols(used_[1]) * own_columns_[1].leftCols(used_[1]).transpose();
}

template <class Work>
void PairContact::for_full(int side, const FullMember& member, const Work& work) const {
  for_parts(side, [&](std::size_t at, bool is_vertex) {
    const BodyCandidates& candidates = candidates_[at];
    for (std::size_t i = 0; i < candidates.all.size(); ++i)
      if (candidates.all[i].is_loaded())
        member.for_places(candidates, i, is_vertex,
                          [&](std::int32_t place, double share) { work(candidates.all[i], place, share); });
  });
}

double PairContact::add_forces(int side, WorldBody& own) const {
  double squares = 0;
  Eigen::VectorXd& gradient = own.full->gradient();
  for_full(side, *own.full, [&](const BodyCandidate& candidate, std::int32_t place, double share) {
    gradient.segment<3>(4 * place) -= share * candidate.force;
    squares += share * share * candidate.force.squaredNorm();
  });
  return squares;
}

void PairContact::add_blocks(int side, WorldBody& own) const {
  for_full(side, *own.full, [&](const BodyCandidate& candidate, std::int32_t place, double share) {
    const StiffnessFactors factors(candidate);
    own.full->push(place, share * share * (factors.used() * factors.used().transpose()));
  });
}

void PairContact::set_ways(const WorldBody& first, const Eigen::Ref<const Eigen::VectorXd>& x_first,
                           const WorldBody& second, const Eigen::Ref<const Eigen::VectorXd>& x_second) {
  for (std::size_t at = 0; at < 2; ++at) {
    const WorldBody &own = at == 0 ? first : second, &other = at == 0 ? second : first;
    const auto &x_own = at == 0 ? x_first : x_second, &x_other = at == 0 ? x_second : x_first;
    ways_[at].resize(2, used_[at]);
    for (Eigen::Index k = 0; k < used_[at]; ++k) {
      const auto& [direction, number] = directions_[at][static_cast<std::size_t>(k)];
      ways_[at](0, k) = own.full ? direction.dot(own.full->way(candidates_[at], number, /*is_vertex=*/true, x_own))
                                 : own_columns_[at].col(k).dot(x_own);
      ways_[at](1, k) = other.full
                            ? direction.dot(other.full->way(candidates_[at], number, /*is_vertex=*/false, x_other))
                            : -other_columns_[at].col(k).dot(x_other);
    }
  }
}

void PairContact::add_product(int side, const WorldBody& body, Eigen::Ref<Eigen::VectorXd> product) const {
  for_parts(side, [&](std::size_t at, bool is_vertex) {
    if (!body.full) {  // what its own way does is in its Hessian
      const auto own = (is_vertex ? own_columns_[at] : other_columns_[at]).leftCols(used_[at]);
      product.noalias() += (is_vertex ? 1 : -1) * (own * ways_[at].row(is_vertex ? 1 : 0).transpose());
      return;
    }
    for (Eigen::Index k = 0; k < used_[at]; ++k) {
      const auto& [direction, number] = directions_[at][static_cast<std::size_t>(k)];
      const Eigen::Vector3d force = ways_[at].col(k).sum() * direction;
      body.full->for_places(candidates_[at], number, is_vertex,
                            [&](std::int32_t place, double share) { product.segment<3>(4 * place) += share * force; });
    }
  });
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
  for (const PairAttachment& own : attachments())
    sum += own.torque_correction(first.placement.position - way_first, second.placement.position - way_second);
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
