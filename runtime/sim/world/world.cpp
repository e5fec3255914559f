#include "runtime/sim/world/world.h"

#include <algorithm>
#include <numeric>

#include "runtime/sim/step/contact_step.h"
#include "runtime/sim/step/stepper.h"
#include "runtime/sim/world/broad_phase.h"

namespace exmat::runtime {
namespace {

constexpr double kOwnMargin = 1e-3;        // of the body's radius: a part at rest may speed up within a step
constexpr std::size_t kSharedIsland = 32;  // bodies; a larger one is shared by the threads

Eigen::Vector3d linear_velocity(const WorldBody& body) { return body.model.frame->velocity(body.state.frame).linear; }

/// The root of a body's tree of touching ones.
int root_of(std::vector<int>& parents, int body) {
  while (parents[static_cast<std::size_t>(body)] != body) {
    int& parent = parents[static_cast<std::size_t>(body)];
    parent = parents[static_cast<std::size_t>(parent)];
    body = parent;
  }
  return body;
}

}  // namespace

World::World(std::vector<WorldBodyStart> bodies, const ContactLaw& law) : law_(law) {
  for (WorldBodyStart& body : bodies) {
    Owned& owned = *owned_.emplace_back(std::make_unique<Owned>(body.kind, std::move(body.state)));
    refresh_weights(*body.kind.model, *body.kind.scene, owned.state, owned.workspace);
    add(body.kind, owned.state, owned.workspace);
  }
}

void World::add(const BodyKind& kind, State& state, Workspace& workspace) {
  bodies_.push_back(std::make_unique<WorldBody>(kind, state, workspace));
  resize();
}

void World::resize() {
  balls_.resize(bodies_.size());
  margins_.resize(bodies_.size());
  against_.resize(bodies_.size());
}

void World::forget(int body) {
  at(body).anew = true;
  std::erase_if(held_, [=](const HeldPair& held) { return held.first == body || held.second == body; });
  for (std::size_t p = 0; p < near_.size(); ++p)
    if (near_[p].first == body || near_[p].second == body) pairs_[p]->reset(0, 0, nullptr);
}

void World::remove(int body) {
  forget(body);
  bodies_.erase(bodies_.begin() + body);
  resize();
  const auto renumber = [=](int& number) { number -= number > body ? 1 : 0; };
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

void World::set_memory(std::vector<HeldPair> held, const std::vector<bool>& anew) {
  for (int i = 0; i < count(); ++i) at(i).anew = anew[static_cast<std::size_t>(i)];
  held_ = std::move(held);
  near_.clear();
}

void World::read_touches(std::vector<BodyTouch>& touches) const {
  touches.clear();
  for (std::size_t p = 0; p < near_.size(); ++p) {
    const auto [first, second] = near_[p];
    pairs_[p]->read_touches(0, at(first), first, second, touches);
    pairs_[p]->read_touches(1, at(second), second, first, touches);
  }
}

WorldReport World::step(int threads) {
  find_pairs(threads);
  gather(threads);
  make_islands();
  WorldReport report;
  report.pairs = static_cast<int>(near_.size());
  step_single_bodies(threads);
  step_islands(threads);
  for (std::size_t i = 0; i < island_count_; ++i) {
    const Island& island = *islands_[i];
    ++report.islands;
    report.touching_pairs += static_cast<int>(island.pairs.size());
    report.largest_island = std::max(report.largest_island, static_cast<int>(island.bodies.size()));
    report.newton_iterations = std::max(report.newton_iterations, island.newton.iterations);
    if (island.newton.status != NewtonStatus::kConverged) ++report.unconverged_islands;
  }
  remember();
  return report;
}

void World::step_single_bodies(int threads) {
  const StageTimer timer(profile_, WorldStage::kSingleBodies);
#pragma omp parallel for schedule(dynamic, 1) num_threads(threads) if (threads > 1)
  for (std::size_t i = 0; i < bodies_.size(); ++i) {
    if (island_of_[i] >= 0) continue;
    WorldBody& own = *bodies_[i];
    own.report = runtime::step(own.model, own.scene, own.state, own.workspace);
  }
}

void World::step_islands(int threads) {
  const StageTimer timer(profile_, WorldStage::kIslands);
  const auto is_large = [](const Island& island) { return island.bodies.size() > kSharedIsland; };
  const auto solve = [](Island& island, int own_threads) {
    island.newton = step_island(island.bodies, island.pairs, island.incidences, own_threads, island.workspace);
  };
#pragma omp parallel for schedule(dynamic, 1) num_threads(threads) if (threads > 1)
  for (std::size_t i = 0; i < island_count_; ++i)
    if (!is_large(*islands_[i])) solve(*islands_[i], 1);
  for (std::size_t i = 0; i < island_count_; ++i)
    if (is_large(*islands_[i])) solve(*islands_[i], threads);
}

/// Pairs of bodies whose bounds, wider by how far they may go, overlap.
void World::find_pairs(int threads) {
  const StageTimer timer(profile_, WorldStage::kBroadPhase);
#pragma omp parallel for schedule(static) num_threads(threads) if (threads > 1)
  for (std::size_t i = 0; i < bodies_.size(); ++i) {
    WorldBody& own = *bodies_[i];
    const double dt = own.scene.time_step;
    const BodyPose pose = pose_of(own.model, own.state);
    const BodyVelocity velocity{own.model.frame->velocity(own.state.frame), own.state.v};
    const double travel = own.contact().travel_bound(pose, velocity, dt);
    const double straight = dt * velocity.linear.norm();
    margins_[i] = kContactMarginSteps * (travel - straight) + dt * dt * own.scene.gravity.norm();
    const DeformationTree::Ball ball = own.surface.bound(own.state.q);
    balls_[i] = {pose.position + pose.rotation * ball.centre,
                 ball.radius + margins_[i] + kContactMarginSteps * straight};
  }
  last_near_.swap(near_);
  overlapping_pairs(balls_, order_, near_);
  const std::size_t others = near_.size();
  for (int i = 0; i < count(); ++i) {
    const WorldBody& own = at(i);
    if (own.touching->may_meet_itself(own.state.q, own.state.v, own.scene.time_step)) near_.emplace_back(i, i);
  }
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
  }
  last_pairs_.clear();
}

const HeldPair* World::held_of(int first, int second) const {
  const auto before = [](const HeldPair& a, const std::pair<int, int>& b) { return std::pair(a.first, a.second) < b; };
  const auto found = std::lower_bound(held_.begin(), held_.end(), std::pair(first, second), before);
  return found != held_.end() && found->first == first && found->second == second ? &*found : nullptr;
}

/// How far apart vertices of one body and the surface of another, or of its own, may be and yet touch in the step [m].
double World::margin_between(int own, int other) const noexcept {
  const WorldBody &a = at(own), &b = at(other);
  if (own == other) return kOwnMargin * balls_[static_cast<std::size_t>(own)].radius;
  const double straight = kContactMarginSteps * b.scene.time_step * (linear_velocity(a) - linear_velocity(b)).norm();
  return margins_[static_cast<std::size_t>(own)] + margins_[static_cast<std::size_t>(other)] + straight;
}

/// Candidates, the surface of one body at a time: what is computed of its shape serves all that are near.
void World::gather(int threads) {
  const StageTimer timer(profile_, WorldStage::kCandidates);
  for (std::vector<Incidence>& pairs : against_) pairs.clear();
  for (std::size_t p = 0; p < near_.size(); ++p) {
    const auto [first, second] = near_[p];
    pairs_[p]->reset(first, second, held_of(first, second));
    against_[static_cast<std::size_t>(second)].push_back({static_cast<int>(p), 0});
    if (first != second) against_[static_cast<std::size_t>(first)].push_back({static_cast<int>(p), 1});
  }
#pragma omp parallel for schedule(dynamic, 4) num_threads(threads) if (threads > 1)
  for (std::size_t i = 0; i < bodies_.size(); ++i) {
    if (against_[i].empty()) continue;
    WorldBody& other = *bodies_[i];
    other.surface.place(other.state.q, other.shape);
    for (const auto& [index, side] : against_[i]) {
      PairContact& pair = *pairs_[static_cast<std::size_t>(index)];
      const int own = pair.body(side);
      pair.gather(law_, side, at(own), other, margin_between(own, static_cast<int>(i)));
    }
  }
}

/// Bodies that touch, directly or through others, in ascending order of their first body.
void World::make_islands() {
  parents_.resize(bodies_.size());
  std::iota(parents_.begin(), parents_.end(), 0);
  island_of_.assign(bodies_.size(), -1);
  place_in_island_.assign(bodies_.size(), -1);
  island_count_ = 0;
  for (std::size_t p = 0; p < near_.size(); ++p) {
    if (pairs_[p]->empty()) continue;
    const int a = root_of(parents_, near_[p].first), b = root_of(parents_, near_[p].second);
    parents_[static_cast<std::size_t>(std::max(a, b))] = std::min(a, b);
  }
  const auto add_body = [&](int body) {
    const auto root = static_cast<std::size_t>(root_of(parents_, body));
    if (island_of_[root] < 0) {
      if (island_count_ == islands_.size()) islands_.push_back(std::make_unique<Island>());
      Island& fresh = *islands_[island_count_];
      fresh.bodies.clear();
      fresh.pairs.clear();
      island_of_[root] = static_cast<int>(island_count_++);
    }
    const auto index = static_cast<std::size_t>(body);
    island_of_[index] = island_of_[root];
    if (place_in_island_[index] >= 0) return;
    Island& island = *islands_[static_cast<std::size_t>(island_of_[index])];
    place_in_island_[index] = static_cast<int>(island.bodies.size());
    island.bodies.push_back(bodies_[index].get());
  };
  for (std::size_t p = 0; p < near_.size(); ++p) {
    if (pairs_[p]->empty()) continue;
    add_body(near_[p].first);
    add_body(near_[p].second);
  }
  for (std::size_t i = 0; i < island_count_; ++i) {
    std::vector<std::vector<Incidence>>& incidences = islands_[i]->incidences;
    incidences.resize(std::max(incidences.size(), islands_[i]->bodies.size()));
    for (std::vector<Incidence>& pairs : incidences) pairs.clear();
  }
  for (std::size_t p = 0; p < near_.size(); ++p) {
    if (pairs_[p]->empty()) continue;
    const auto first = static_cast<std::size_t>(near_[p].first), second = static_cast<std::size_t>(near_[p].second);
    Island& island = *islands_[static_cast<std::size_t>(island_of_[first])];
    const auto index = static_cast<int>(island.pairs.size());
    island.pairs.push_back(pairs_[p].get());
    island.pairs.back()->number(place_in_island_[first], place_in_island_[second]);
    island.incidences[static_cast<std::size_t>(place_in_island_[first])].push_back({index, 0});
    if (first != second) island.incidences[static_cast<std::size_t>(place_in_island_[second])].push_back({index, 1});
  }
}

/// What the next step has to know of the contacts of this one.
void World::remember() {
  std::size_t kept = 0;
  std::vector<HeldPair>& next = next_held_;
  for (std::size_t p = 0; p < near_.size(); ++p) {
    if (pairs_[p]->empty()) continue;
    if (kept == next.size()) next.emplace_back();
    HeldPair& held = next[kept];
    pairs_[p]->commit(at(near_[p].first), at(near_[p].second), held);
    held.first = near_[p].first;
    held.second = near_[p].second;
    if (!held.held[0].empty() || !held.held[1].empty()) ++kept;
  }
  next.resize(kept);
  held_.swap(next);
  for (const auto& body : bodies_) body->anew = false;
}

Energies World::energies() const {
  Energies sum;
  for (const auto& body : bodies_) {
    const Energies own = runtime::energies(body->model, body->scene, body->state);
    sum.kinetic += own.kinetic;
    sum.elastic += own.elastic;
    sum.potential += own.potential;
  }
  return sum;
}

}  // namespace exmat::runtime
