#include "runtime/sim/world/world.h"

#include <algorithm>
#include <deque>

#include "runtime/sim/space/full/full_body.h"
#include "runtime/sim/step/contact_step.h"
#include "runtime/sim/step/divided_step.h"
#include "runtime/sim/step/sleep.h"
#include "runtime/sim/world/broad_phase.h"
#include "runtime/sim/world/for_all.h"

namespace exmat::runtime {
namespace {

constexpr double kOwnMargin = 1e-3;        // of the body's radius: a part at rest may speed up within a step
constexpr std::size_t kSharedIsland = 32;  // bodies; a larger one is shared by the threads
constexpr int kSleepersAtOnce = 256, kBoundsAtOnce = 32;  // bodies that a thread takes at a time

Eigen::Vector3d linear_velocity(const WorldBody& body) { return body.model.frame->velocity(body.state.frame).linear; }

}  // namespace

World::World(std::vector<WorldBodyStart> bodies, const ContactLaw& law) : law_(law) {
  for (WorldBodyStart& body : bodies) {
    State& state = *owned_.emplace_back(std::make_unique<State>(std::move(body.state)));
    add(body.kind, state);
  }
}

void World::add(const BodyKind& kind, State& state) {
  Member member{kind, &state};
  if (kind.surface) member.touching = std::make_unique<WorldBody>(kind, state);
  bodies_.reserve(bodies_.size() + 1);
  margins_.resize(bodies_.size() + 1);
  balls_.resize(bodies_.size() + 1);
  against_.resize(bodies_.size() + 1);
  if (kind.surface) touching_.push_back(count());
  member.crowd_kind = crowd_.add(*kind.model, *kind.scene);
  if (kind.full != nullptr && kind.scene->space.space != Space::kReduced) reserve_full(kind);
  bodies_.push_back(std::move(member));
  if (!island_of_.empty()) island_of_.push_back(-1);
}

void World::wake_neighbours(int body) {
  for (const HeldPair& held : held_) {
    if (held.first == body) wake(state(held.second));
    if (held.second == body) wake(state(held.first));
  }
  for (int own = 0; own < count(); ++own)
    for (const Attachment& attachment : state(own).attachments) {
      if (!attachment.other) continue;
      if (own == body) wake(state(attachment.other->body));
      if (attachment.other->body == body) wake(state(own));
    }
}

bool World::is_attached(int body) const noexcept {
  for (int own = 0; own < count(); ++own)
    for (const Attachment& attachment : state(own).attachments)
      if (attachment.other && attachment.holds() && (own == body || attachment.other->body == body)) return true;
  return false;
}

void World::forget(int body) {
  if (!at(body).state->full) drop_full_scratch(at(body));
  state(body).contacts.first_step = true;
  if (!at(body).touching) return;
  wake_neighbours(body);
  at(body).is_bounded = false;
  std::erase_if(held_, [=](const HeldPair& held) { return held.first == body || held.second == body; });
  for (std::size_t p = 0; p < near_.size(); ++p)
    if (near_[p].first == body || near_[p].second == body) pairs_[p]->reset(0, 0, nullptr);
}

void World::remove(int body) {
  forget(body);
  crowd_.remove(at(body).crowd_kind);
  // The model may go with its last body, and another one be made in its place.
  const FullModel* const full = at(body).kind.full;
  if (full != nullptr && std::ranges::count(bodies_, full, [](const Member& own) { return own.kind.full; }) == 1)
    std::erase_if(idle_full_, [=](const auto& idle) { return idle.first == full; });
  std::erase_if(state(body).attachments, [](const Attachment& own) { return own.other.has_value(); });
  bodies_.erase(bodies_.begin() + body);
  for (const Member& member : bodies_) forget_body(body, member.state->attachments);
  if (!island_of_.empty()) island_of_.erase(island_of_.begin() + body);
  const auto renumber = [=](int& number) { number -= number > body ? 1 : 0; };
  std::erase(touching_, body);
  for (int& number : touching_) renumber(number);
  for (Member& member : bodies_) member.is_bounded = false;
  for (HeldPair& held : held_) {
    renumber(held.first);
    renumber(held.second);
  }
  std::size_t kept = 0;
  for (std::size_t p = 0; p < near_.size(); ++p) {
    if (near_[p].first == body || near_[p].second == body) continue;
    near_[kept] = near_[p];
    renumber(near_[kept].first);
    renumber(near_[kept].second);
    pairs_[kept++].swap(pairs_[p]);
  }
  near_.resize(kept);
}

void World::fit(int body) {
  Member& own = at(body);
  crowd_.fit(own.crowd_kind, *own.kind.scene);
  if (own.touching) own.touching->workspace.near.emplace(*own.kind.model, *own.kind.scene);
  own.held.reset();
  if (!own.state->attachments.empty()) fit_attachments(body);
  prepare_contacts(*own.kind.model, own.kind.scene->obstacles.size(), *own.state);
}

void World::fit_attachments(int body) {
  Member& own = at(body);
  if (own.state->attachments.empty()) own.held.reset();
  if (own.state->attachments.empty() && !own.touching) return;
  if (!own.touching && own.held == nullptr) own.held = std::make_unique<Workspace>(*own.kind.model, *own.kind.scene);
  scratch(body).fit(*own.kind.model, *own.kind.scene, own.state->attachments);
}

void World::set_memory(std::vector<HeldPair> held) {
  held_ = std::move(held);
  take_states();
}

void World::take_states() {
  for (Member& member : bodies_) {
    member.is_bounded = false;
    if (member.state->full)
      enter_full(member);
    else
      drop_full_scratch(member);
  }
  near_.clear();
  island_of_.clear();
}

void World::read_touches(std::vector<BodyTouch>& touches) const {
  touches.clear();
  for (std::size_t p = 0; p < near_.size(); ++p) {
    const auto [first, second] = near_[p];
    pairs_[p]->read_touches(0, touching(first), first, second, touches);
    pairs_[p]->read_touches(1, touching(second), second, first, touches);
  }
}

Workspace& World::scratch(int body) noexcept {
  Member& own = at(body);
  if (own.touching) return own.touching->workspace;
  return own.held != nullptr ? *own.held : crowd_.scratch(own.crowd_kind);
}

void World::prepare(int threads) {
  crowd_.prepare(threads);
  for (int i = 0; i < count(); ++i) {
    const Member& own = at(i);
    if (own.full != nullptr) own.full->fit(*own.kind.full, *own.kind.scene);
    if (!holds_modes(own.state->attachments)) continue;
    const Workspace* const scratch = own.touching ? &own.touching->workspace : own.held.get();
    if (scratch == nullptr || !scratch->near || !scratch->near->held.fits(own.state->attachments)) fit_attachments(i);
  }
}

/// Frames that a motion moves go where it has them at the end of the step; what broke bears nothing.
void World::move_attachments() {
  links_.clear();
  for (int i = 0; i < count(); ++i)
    for (Attachment& attachment : state(i).attachments) {
      attachment.follow(state(i).time, static_cast<double>(state(i).step + 1) * scene(i).time_step);
      if (attachment.broken) {
        attachment.force.setZero();
        attachment.torque.setZero();
      } else if (attachment.other) {
        const int other = attachment.other->body;
        links_.push_back({std::minmax({i, other}), i < other ? 0 : 1, &attachment});
      }
    }
  std::ranges::stable_sort(links_, {}, &Link::bodies);
}

std::span<const World::Link> World::links_of(const std::pair<int, int>& bodies) const noexcept {
  return {std::ranges::lower_bound(links_, bodies, {}, &Link::bodies),
          std::ranges::upper_bound(links_, bodies, {}, &Link::bodies)};
}

/// Scratch for the first body of a kind that enters full space: later ones make theirs as they enter.
void World::reserve_full(const BodyKind& kind) {
  const auto has = [&](const Member& member) { return member.kind.full == kind.full && member.full != nullptr; };
  if (std::ranges::any_of(idle_full_, [&](const auto& idle) { return idle.first == kind.full; }) ||
      std::ranges::any_of(bodies_, has))
    return;
  idle_full_.emplace_back(kind.full,
                          std::make_unique<FullWorkspace>(*kind.full, *kind.scene, accuracy_of(*kind.scene)));
}

void World::enter_full(Member& member) {
  enter_full_space(*member.kind.full, *member.kind.model, *member.state);
  if (member.full != nullptr) return;
  take_full_scratch(member);
  if (!member.touching) return;
  WorldBody& own = *member.touching;
  own.full = std::make_unique<FullMember>(*member.kind.full, own.model, own.scene(), own.state, own.workspace,
                                          *member.full, *own.touching);
  member.is_bounded = false;
}

void World::was_pushed(int body) {
  Member& own = at(body);
  if (own.kind.full != nullptr && own.kind.scene->space.space == Space::kAuto) enter_full(own);
}

void World::take_full_scratch(Member& member) {
  const auto idle = std::ranges::find(idle_full_, member.kind.full, [](const auto& own) { return own.first; });
  if (idle == idle_full_.end()) {
    member.full =
        std::make_unique<FullWorkspace>(*member.kind.full, *member.kind.scene, accuracy_of(*member.kind.scene));
    return;
  }
  member.full = std::move(idle->second);
  idle_full_.erase(idle);
  member.full->fit(*member.kind.full, *member.kind.scene);
}

void World::leave_full(Member& member) noexcept {
  leave_full_space(*member.state);
  drop_full_scratch(member);
}

void World::drop_full_scratch(Member& member) noexcept {
  if (member.touching) member.touching->full.reset();
  if (member.full != nullptr) idle_full_.emplace_back(member.kind.full, std::move(member.full));
}

bool World::is_in_island(int body) const noexcept {
  return !island_of_.empty() && island_of_[static_cast<std::size_t>(body)] >= 0;
}

bool World::stepped_with_others(int body) const noexcept {
  return is_in_island(body) &&
         islands_[static_cast<std::size_t>(island_of_[static_cast<std::size_t>(body)])]->bodies.size() > 1;
}

/// True if a load asks for full space. Contact with other bodies does not.
bool World::asks_for_full(int body) {
  Member& own = at(body);
  StepReport last = own.report;
  if (stepped_with_others(body)) last.contacts = 0;
  return asks_for_full_space(*own.kind.scene, last, *own.state);
}

/// Puts each body into the space of its next step.
void World::choose_spaces() {
  const auto put = [this](Member& own, bool in_full) {
    if (in_full)
      enter_full(own);
    else if (own.state->full)
      leave_full(own);
  };
  asking_.clear();
  for (int i = 0; i < count(); ++i) {
    Member& own = at(i);
    if (own.kind.full == nullptr || own.asleep) continue;
    const bool asks = asks_for_full(i);
    if (asks && own.kind.scene->space.space == Space::kAuto)
      asking_.push_back(i);
    else
      put(own, asks);
  }
  const auto pushed = [this](int body) { return at(body).state->applied_force.squaredNorm(); };
  const auto alone = [this](int body) { return at(body).state->full ? at(body).state->full->alone : 0; };
  const auto before = [&](int a, int b) {
    const double push_a = pushed(a), push_b = pushed(b);
    if (push_a != push_b) return push_a > push_b;
    return alone(a) != alone(b) ? alone(a) < alone(b) : a < b;
  };
  if (std::ssize(asking_) > most_full_) std::ranges::sort(asking_, before);
  for (std::size_t k = 0; k < asking_.size(); ++k) put(at(asking_[k]), static_cast<int>(k) < most_full_);
}

WorldReport World::step(int threads, StepObserver* observer) {
  prepare(threads);
  move_attachments();
  find_sleepers(threads);
  choose_spaces();
  find_contacts(threads);
  step_crowd(threads, observer);
  step_islands(threads, observer);
  WorldReport report;
  report.asleep = static_cast<int>(std::ranges::count_if(bodies_, &Member::asleep));
  report.pairs = static_cast<int>(near_.size());
  for (std::size_t i = 0; i < island_count_; ++i) {
    const Island& island = *islands_[i];
    ++report.islands;
    report.touching_pairs += static_cast<int>(island.pairs.size());
    report.largest_island = std::max(report.largest_island, static_cast<int>(island.bodies.size()));
    report.newton_iterations = std::max(report.newton_iterations, island.newton.iterations);
    if (island.newton.status != NewtonStatus::kConverged) ++report.unconverged_islands;
    if (island.divided) ++report.divided_islands;
  }
  return report;
}

void World::find_sleepers(int threads) {
  const auto look = [this](std::size_t i) {
    Member& own = bodies_[i];
    own.asleep = own.state->sleep.asleep && sleeps(*own.kind.model, *own.kind.scene, *own.state);
  };
  for_all(bodies_.size(), threads, look, kSleepersAtOnce);
}

/// Who touches whom. If all sleep that may touch anybody, nobody does.
void World::find_contacts(int threads) {
  island_count_ = 0;
  island_of_.clear();
  found_contacts_ = false;
  if (std::ranges::all_of(touching_, [&](int body) { return at(body).asleep; })) return;
  found_contacts_ = true;
  find_pairs(threads);
  gather(threads);
  make_islands(threads);
}

void World::step_crowd(int threads, StepObserver* observer) {
  const StageTimer timer(profile_, WorldStage::kSingleBodies);
  crowd_.begin();
  const auto goes_alone = [](const Member& own) { return own.state->full || holds_modes(own.state->attachments); };
  for (const Member& own : bodies_)
    if (!goes_alone(own)) crowd_.count(own.crowd_kind, *own.kind.scene);
  for (int i = 0; i < count(); ++i) {
    Member& own = at(i);
    const bool alone = goes_alone(own);
    if (!is_in_island(i) && !own.asleep) {
      Workspace* scratch = nullptr;  // the crowd's, which all share, stays in the cache
      if (alone) scratch = own.touching ? &own.touching->workspace : own.held.get();
      const FullModel* const full = own.state->full ? own.kind.full : nullptr;
      crowd_.take({i, own.crowd_kind, own.kind.scene, own.state, scratch, &own.report, full, own.full.get(), alone});
      continue;
    }
    if (!alone) crowd_.leave(own.crowd_kind, *own.kind.scene);
    if (own.asleep) own.report = sleep_through(*own.kind.scene, *own.state);
  }
  crowd_.step(threads, observer, profile_);
}

void World::step_islands(int threads, StepObserver* observer) {
  if (!found_contacts_) return;
  {
    const StageTimer timer(profile_, WorldStage::kIslands);
    const auto is_large = [](const Island& island) { return island.bodies.size() > kSharedIsland; };
    const auto solve = [&](Island& island, int own_threads) {
      island.newton = step_island(island, own_threads);
      for (std::size_t i = 0; i < island.bodies.size(); ++i) {
        const WorldBody& body = *island.bodies[i];
        at(island.numbers[i]).report = body.report;
        if (observer != nullptr) observer->after_step(island.numbers[i], body.report, body.workspace);
      }
    };
    const auto solve_small = [&](std::size_t i) {
      if (!is_large(*islands_[i])) solve(*islands_[i], 1);
    };
    for_all(island_count_, threads, solve_small, 1);
    for (std::size_t i = 0; i < island_count_; ++i)
      if (is_large(*islands_[i])) solve(*islands_[i], threads);
  }
  remember();
}

NewtonReport World::step_island(Island& island, int threads) {
  auto& [bodies, numbers, pairs, near, incidences, held, workspace, newton, divided] = island;
  newton = begin_island_step(bodies, pairs, incidences, threads, workspace);
  const auto may_divide = [](const WorldBody* own) { return !own->full || !own->full->has_bones(); };
  divided = has_no_solution(newton, bodies.front()->scene().newton) && std::ranges::all_of(bodies, may_divide);
  return divided ? step_in_parts(island, threads) : end_island_step(bodies, pairs, incidences, newton, workspace);
}

NewtonReport World::step_in_parts(Island& island, int threads) {
  const std::span<WorldBody* const> bodies = island.bodies;
  const std::span<PairContact* const> pairs = island.pairs;
  std::deque<DividedStep> steps;
  for (const WorldBody* const own : bodies) steps.emplace_back(own->scene(), own->state);
  NewtonReport sum;
  const auto begin = [&](int parts) {
    sum = {};
    for (std::size_t i = 0; i < bodies.size(); ++i) {
      steps[i].begin(parts);
      bodies[i]->take_scene(steps[i].scene());
    }
  };
  const auto take = [&](int part) {
    for (DividedStep& step : steps) step.begin_part(part);
    gather_again(island, part == 0);
    const NewtonReport own = begin_island_step(bodies, pairs, island.incidences, threads, island.workspace);
    const NewtonStatus before = sum.status;
    runtime::add(end_island_step(bodies, pairs, island.incidences, own, island.workspace), sum);
    if (sum.status == NewtonStatus::kConverged) sum.status = before;
    std::uint32_t status = 0;
    for (std::size_t i = 0; i < bodies.size(); ++i) {
      steps[i].end_part(bodies[i]->report);
      status |= bodies[i]->report.status;
    }
    return status;
  };
  island.divided = take_in_parts(begin, take);
  if (!island.divided) take(0);
  for (std::size_t i = 0; island.divided && i < bodies.size(); ++i) {
    bodies[i]->report = steps[i].end();
    bodies[i]->take_scene(steps[i].scene());
  }
  return sum;
}

/// Candidates of an island's pairs at the start of a step, or after a part of it.
void World::gather_again(Island& island, bool at_start) {
  island.held.resize(std::max(island.held.size(), island.pairs.size()));
  for (std::size_t k = 0; !at_start && k < island.pairs.size(); ++k) {
    const auto [first, second] = near_[island.near[k]];
    island.pairs[k]->commit(touching(first), touching(second), island.held[k]);
  }
  for (WorldBody* const own : island.bodies) own->place_surface();
  for (std::size_t k = 0; k < island.pairs.size(); ++k) {
    PairContact& pair = *island.pairs[k];
    const auto [first, second] = near_[island.near[k]];
    if (!begin_pair(island.near[k], at_start ? held_of(first, second) : &island.held[k])) {
      gather_side(pair, 0, first, second);
      if (first != second) gather_side(pair, 1, second, first);
    }
    number_bodies(island.near[k]);
  }
}

/// A ball that holds the body at the end of the step, too. Of a body that sleeps it stays what it is.
void World::bound(int body) {
  Member& member = at(body);
  if (member.asleep && member.is_bounded) return;
  member.is_bounded = member.asleep;
  WorldBody& own = *member.touching;
  const double dt = own.scene().time_step;
  const auto index = static_cast<std::size_t>(body);
  if (own.full) {
    own.full->place_surface();
    const MovingSurface& surface = own.full->surface();
    const double straight = dt * linear_velocity(own).norm();
    own.travel = dt * surface.speed();
    margins_[index] = kContactMarginSteps * std::max(0.0, own.travel - straight) + dt * dt * own.scene().gravity.norm();
    balls_[index] = surface.bound();
    balls_[index].radius += margins_[index] + kContactMarginSteps * straight;
    return;
  }
  const BodyPose pose = pose_of(own.model, own.state);
  const BodyVelocity velocity{own.model.frame->velocity(own.state.frame), own.state.v};
  own.travel = own.contact().travel_bound(pose, velocity, dt);
  const double straight = dt * velocity.linear.norm();
  margins_[index] = kContactMarginSteps * (own.travel - straight) + dt * dt * own.scene().gravity.norm();
  const DeformationTree::Ball ball = own.surface.bound(own.state.q);
  balls_[index] = {pose.position + pose.rotation * ball.centre,
                   ball.radius + margins_[index] + kContactMarginSteps * straight};
}

/// Pairs of bodies that meet and whose bounds, wider by how far they may go, overlap.
void World::find_pairs(int threads) {
  const StageTimer timer(profile_, WorldStage::kBroadPhase);
  for_all(
      touching_.size(), threads, [this](std::size_t i) { bound(touching_[i]); }, kBoundsAtOnce);
  last_near_.swap(near_);
  overlapping_pairs(balls_, touching_, order_, near_);
  std::erase_if(near_, [&](const auto& pair) {
    return !at(pair.first).kind.scene->meeting.meets(at(pair.second).kind.scene->meeting);
  });
  const std::size_t others = near_.size();
  for (const Link& link : links_)
    if (!std::ranges::binary_search(near_.begin(), near_.begin() + static_cast<std::ptrdiff_t>(others), link.bodies) &&
        (near_.size() == others || near_.back() != link.bodies))
      near_.push_back(link.bodies);
  for (const int body : touching_)
    if (touching(body).may_meet_itself()) near_.emplace_back(body, body);
  if (near_.size() > others) std::ranges::sort(near_);
  keep_pairs();
}

/// Pairs that were near in the last step have their PairContact, which knows what is near; others take what is left.
void World::keep_pairs() {
  last_pairs_.swap(pairs_);
  pairs_.resize(std::max(last_pairs_.size(), near_.size()));
  std::size_t last = 0;
  for (std::size_t p = 0; p < near_.size(); ++p) {
    while (last < last_near_.size() && last_near_[last] < near_[p]) ++last;
    if (last < last_near_.size() && last_near_[last] == near_[p]) pairs_[p] = std::move(last_pairs_[last]);
  }
  std::size_t left = 0;
  for (std::unique_ptr<PairContact>& pair : pairs_) {
    if (pair) continue;
    while (left < last_pairs_.size() && !last_pairs_[left]) ++left;
    pair = left < last_pairs_.size() ? std::move(last_pairs_[left]) : std::make_unique<PairContact>();
    pair->forget();
    pair->reset(0, 0, nullptr);
  }
  last_pairs_.clear();
  is_gathered_.assign(near_.size(), false);
}

const HeldPair* World::held_of(int first, int second) const {
  const auto before = [](const HeldPair& a, const std::pair<int, int>& b) { return std::pair(a.first, a.second) < b; };
  const auto found = std::lower_bound(held_.begin(), held_.end(), std::pair(first, second), before);
  return found != held_.end() && found->first == first && found->second == second ? &*found : nullptr;
}

/// Distance up to which vertices of one body and the surface of another, or of its own, may touch in the step [m].
double World::margin_between(int own, int other) const noexcept {
  const WorldBody &a = touching(own), &b = touching(other);
  if (own == other) return kOwnMargin * balls_[static_cast<std::size_t>(own)].radius;
  const double straight = kContactMarginSteps * b.scene().time_step * (linear_velocity(a) - linear_velocity(b)).norm();
  return margins_[static_cast<std::size_t>(own)] + margins_[static_cast<std::size_t>(other)] + straight;
}

/// Candidates of pairs of which one is awake, the surface of one body at a time: what is computed of its shape serves
/// all that are near.
void World::gather(int threads) {
  const StageTimer timer(profile_, WorldStage::kCandidates);
  for (std::vector<Incidence>& pairs : against_) pairs.clear();
  for (std::size_t p = 0; p < near_.size(); ++p) {
    const auto [first, second] = near_[p];
    if (is_gathered_[p] || (at(first).asleep && at(second).asleep)) continue;
    is_gathered_[p] = true;
    if (begin_pair(p, held_of(first, second))) continue;
    against_[static_cast<std::size_t>(second)].push_back({static_cast<int>(p), 0});
    if (first != second) against_[static_cast<std::size_t>(first)].push_back({static_cast<int>(p), 1});
  }
  for_all(bodies_.size(), threads, [this](std::size_t i) {
    if (against_[i].empty()) return;
    const auto other = static_cast<int>(i);
    if (!touching(other).full) touching(other).place_surface();
    for (const auto& [index, side] : against_[i]) {
      PairContact& pair = *pairs_[static_cast<std::size_t>(index)];
      gather_side(pair, side, pair.body(side), other);
    }
  });
}

/// True if the two are attached to each other, and do not touch then: contacts where the patches meet would work
/// against the attachment.
bool World::begin_pair(std::size_t pair, const HeldPair* held) {
  const auto [first, second] = near_[pair];
  pairs_[pair]->reset(first, second, nullptr);
  for (const Link& link : links_of(near_[pair]))
    if (link.attachment->holds()) pairs_[pair]->attach(*link.attachment, link.side, touching(first), touching(second));
  if (!pairs_[pair]->attachments().empty()) return true;
  pairs_[pair]->reset(first, second, held);
  return false;
}

void World::gather_side(PairContact& pair, int side, int own, int other) {
  pair.gather(law_, side, touching(own), touching(other), margin_between(own, other));
}

/// Numbers the bodies of a pair by their places in their island.
void World::number_bodies(std::size_t pair) {
  const auto [first, second] = near_[pair];
  pairs_[pair]->number(place_in_island_[static_cast<std::size_t>(first)],
                       place_in_island_[static_cast<std::size_t>(second)]);
}

/// True if the two bodies of a pair step together: they may touch or are attached, or they sleep like that.
bool World::is_linked(std::size_t pair) const {
  if (is_gathered_[pair]) return !pairs_[pair]->empty();
  return held_of(near_[pair].first, near_[pair].second) != nullptr || !links_of(near_[pair]).empty();
}

void World::unite() {
  linked_.reset(bodies_.size());
  for (std::size_t p = 0; p < near_.size(); ++p)
    if (is_linked(p)) linked_.join(near_[p].first, near_[p].second);
}

/// Wakes all that an awake body is linked to. True if anybody woke.
bool World::wake_islands() {
  std::vector<int>& awake = place_in_island_;  // of each root
  awake.assign(bodies_.size(), 0);
  for (const int body : touching_)
    if (!at(body).asleep) awake[static_cast<std::size_t>(linked_.root(body))] = 1;
  bool any = false;
  for (const int body : touching_) {
    if (!at(body).asleep || awake[static_cast<std::size_t>(linked_.root(body))] == 0) continue;
    wake(state(body));
    at(body).asleep = false;
    any = true;
  }
  return any;
}

void World::make_islands(int threads) {
  unite();
  while (wake_islands()) {
    gather(threads);
    unite();
  }
  collect_islands();
}

/// Bodies that touch, directly or through others, in ascending order of their first body.
void World::collect_islands() {
  island_of_.assign(bodies_.size(), -1);
  place_in_island_.assign(bodies_.size(), -1);
  const auto is_used = [&](std::size_t p) { return is_gathered_[p] && !pairs_[p]->empty(); };
  const auto add_body = [&](int body) {
    const auto root = static_cast<std::size_t>(linked_.root(body));
    if (island_of_[root] < 0) {
      if (island_count_ == islands_.size()) islands_.push_back(std::make_unique<Island>());
      Island& fresh = *islands_[island_count_];
      fresh.bodies.clear();
      fresh.numbers.clear();
      fresh.pairs.clear();
      fresh.near.clear();
      island_of_[root] = static_cast<int>(island_count_++);
    }
    const auto index = static_cast<std::size_t>(body);
    island_of_[index] = island_of_[root];
    if (place_in_island_[index] >= 0) return;
    Island& island = *islands_[static_cast<std::size_t>(island_of_[index])];
    place_in_island_[index] = static_cast<int>(island.bodies.size());
    island.bodies.push_back(at(body).touching.get());
    island.numbers.push_back(body);
  };
  for (std::size_t p = 0; p < near_.size(); ++p) {
    if (!is_used(p)) continue;
    add_body(near_[p].first);
    add_body(near_[p].second);
  }
  for (std::size_t i = 0; i < island_count_; ++i) {
    std::vector<std::vector<Incidence>>& incidences = islands_[i]->incidences;
    incidences.resize(std::max(incidences.size(), islands_[i]->bodies.size()));
    for (std::vector<Incidence>& pairs : incidences) pairs.clear();
  }
  for (std::size_t p = 0; p < near_.size(); ++p) {
    if (!is_used(p)) continue;
    const auto first = static_cast<std::size_t>(near_[p].first), second = static_cast<std::size_t>(near_[p].second);
    Island& island = *islands_[static_cast<std::size_t>(island_of_[first])];
    const auto index = static_cast<int>(island.pairs.size());
    island.pairs.push_back(pairs_[p].get());
    island.near.push_back(p);
    number_bodies(p);
    island.incidences[static_cast<std::size_t>(place_in_island_[first])].push_back({index, 0});
    if (first != second) island.incidences[static_cast<std::size_t>(place_in_island_[second])].push_back({index, 1});
  }
}

/// Keeps the contacts of this step for the next one; those of bodies that slept through it stay.
void World::remember() {
  std::size_t kept = 0;
  std::vector<HeldPair>& next = next_held_;
  const auto add = [&]() -> HeldPair& {
    if (kept == next.size()) next.emplace_back();
    return next[kept];
  };
  for (std::size_t p = 0; p < near_.size(); ++p) {
    const auto [first, second] = near_[p];
    if (!is_gathered_[p]) {
      const HeldPair* const last = held_of(first, second);
      if (last == nullptr) continue;
      add() = *last;
      ++kept;
      continue;
    }
    if (pairs_[p]->empty()) continue;
    HeldPair& held = add();
    pairs_[p]->commit(touching(first), touching(second), held);
    held.first = first;
    held.second = second;
    if (!held.held[0].empty() || !held.held[1].empty()) ++kept;
  }
  next.resize(kept);
  held_.swap(next);
}

Energies World::energies(int body) const noexcept {
  const BodyKind& kind = at(body).kind;
  return runtime::energies(kind.full, *kind.model, *kind.scene, state(body), at(body).full.get());
}

Energies World::energies() const {
  Energies sum;
  for (int i = 0; i < count(); ++i) {
    const Energies own = energies(i);
    sum.kinetic += own.kinetic;
    sum.elastic += own.elastic;
    sum.potential += own.potential;
  }
  for (const HeldPair& pair : held_) sum.contact += pair.energy;
  for (int i = 0; i < count(); ++i)
    for (const Attachment& own : state(i).attachments)
      if (own.holds() && own.other)
        sum.contact +=
            spring_energy_of(own, pose_of(model(i), state(i)), pose_of(model(own.other->body), state(own.other->body)));
  return sum;
}

}  // namespace exmat::runtime
