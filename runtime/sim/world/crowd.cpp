#include "runtime/sim/world/crowd.h"

#include <algorithm>
#include <chrono>
#include <span>

#include "runtime/sim/space/full/full_body.h"
#include "runtime/sim/step/stepper.h"
#include "runtime/sim/world/for_all.h"

namespace exmat::runtime {
namespace {

constexpr std::size_t kShares = 16;  // of a thread's groups: at so many times threads even out

}  // namespace

int Crowd::add(const Model& model, const StepScene& scene) {
  auto kind = std::ranges::find(kinds_, &model, &Kind::model);
  if (kind == kinds_.end()) kind = std::ranges::find(kinds_, nullptr, &Kind::model);
  if (kind == kinds_.end()) kind = kinds_.emplace(kind);
  if (kind->model == nullptr) *kind = {&model, scene};
  ++kind->bodies;
  std::size_t most = 0;
  for (const Kind& own : kinds_) most += static_cast<std::size_t>(own.bodies);
  bodies_.reserve(most);
  groups_.reserve(most);
  const int found = static_cast<int>(kind - kinds_.begin());
  fit(found, scene);
  return found;
}

void Crowd::remove(int kind) {
  const auto index = static_cast<std::size_t>(kind);
  if (--kinds_[index].bodies > 0) return;
  kinds_[index] = {};  // the model may go with its last body, and another one be made in its place
  for (Thread& thread : threads_) thread.of_kind[index].reset();
}

void Crowd::fit(int kind, const StepScene& scene) {
  StepScene& sized = kinds_[static_cast<std::size_t>(kind)].scene;
  if (scene.obstacles.size() > sized.obstacles.size()) sized = scene;
  prepare(std::max(1, static_cast<int>(threads_.size())));
}

/// Threads that have something to do where all bodies go in groups as large as can be.
int Crowd::useful(int threads) const noexcept {
  std::ptrdiff_t groups = 0;
  for (const Kind& kind : kinds_)
    groups += goes_in_lanes(kind) ? (kind.bodies + kLanes - 1) / kLanes + kFewestLanes - 1 : kind.bodies;
  return static_cast<int>(std::clamp<std::ptrdiff_t>(groups, 1, threads));
}

bool Crowd::goes_in_lanes(const Kind& kind) noexcept {
  return kind.bodies >= kFewestLanes && !kind.model->internal_force.polynomial();
}

void Crowd::prepare(int threads) {
  const auto wanted = static_cast<std::size_t>(useful(threads));
  if (threads_.size() < wanted) threads_.resize(wanted);
  for (Thread& thread : threads_) size(thread);
}

void Crowd::size(Thread& thread) const {
  thread.of_kind.resize(kinds_.size());
  for (std::size_t k = 0; k < kinds_.size(); ++k) {
    const Kind& kind = kinds_[k];
    if (kind.model == nullptr) continue;
    const std::size_t wanted =
        goes_in_lanes(kind) ? static_cast<std::size_t>(std::min<std::ptrdiff_t>(kind.bodies, kLanes)) : 1;
    const auto serves = [&](const LaneWorkspace& workspace) {
      const std::optional<ContactProblemWorkspace>& near = workspace.body(0).near;
      return workspace.bodies() >= wanted && near.has_value() == touches(*kind.model, kind.scene) &&
             (!near || near->contact.obstacles.capacity() >= kind.scene.obstacles.size());
    };
    std::optional<LaneWorkspace>& own = thread.of_kind[k];
    if (!own || !serves(*own)) own.emplace(*kind.model, kind.scene, wanted);
  }
}

void Crowd::begin() noexcept {
  bodies_.clear();
  groups_.clear();
  for (Kind& kind : kinds_) {
    kind.able = kind.seen = 0;
    kind.open = -1;
  }
}

void Crowd::count(int kind, const StepScene& scene) noexcept {
  Kind& own = kinds_[static_cast<std::size_t>(kind)];
  if (own.bodies >= kFewestLanes && can_step_side_by_side(*own.model, scene)) ++own.able;
}

bool Crowd::is_in_lanes(int kind, const StepScene& scene) noexcept {
  Kind& own = kinds_[static_cast<std::size_t>(kind)];
  if (own.able < kFewestLanes || !can_step_side_by_side(*own.model, scene)) return false;
  return own.seen++ < own.in_lanes();
}

void Crowd::leave(int kind, const StepScene& scene) noexcept { is_in_lanes(kind, scene); }

void Crowd::take(const Body& body) {
  const auto index = static_cast<int>(bodies_.size());
  bodies_.push_back(body);
  Kind& kind = kinds_[static_cast<std::size_t>(body.kind)];
  const bool in_lanes = !body.goes_alone && is_in_lanes(body.kind, *body.scene);
  if (!in_lanes || kind.open < 0) {
    groups_.push_back({body.kind, in_lanes});
    if (in_lanes) kind.open = static_cast<int>(groups_.size()) - 1;
  }
  Group& group = in_lanes ? groups_[static_cast<std::size_t>(kind.open)] : groups_.back();
  group.bodies[group.count++] = index;
  if (group.count == kLanes) kind.open = -1;
}

void Crowd::step(int most_threads, StepObserver* observer, WorldProfile* profile) noexcept {
  const int threads = useful(most_threads);
  const std::size_t groups = groups_.size();
  const auto next_of = [&](std::size_t group) { return group + 1 < groups ? &groups_[group + 1] : nullptr; };
  const auto share = static_cast<int>(std::max<std::size_t>(groups / (kShares * static_cast<std::size_t>(threads)), 1));
  const auto step_one = [&](std::size_t i, std::size_t thread) {
    step_group(groups_[i], next_of(i), threads_[thread], observer, profile != nullptr);
  };
  for_all_by_threads(groups, threads, step_one, share);
  if (profile == nullptr) return;
  for (Thread& thread : threads_) {
    for (std::size_t stage = 0; stage < kStageNames.size(); ++stage) {
      profile->bodies.seconds[stage] += thread.profile.seconds[stage];
      profile->bodies.flops[stage] += thread.profile.flops[stage];
    }
    profile->bodies_seconds += thread.seconds;
    thread.profile = {};
    thread.seconds = 0;
  }
}

void Crowd::step_group(const Group& group, const Group* next, Thread& thread, StepObserver* observer,
                       bool profiled) noexcept {
  using Clock = std::chrono::steady_clock;
  const Clock::time_point start = profiled ? Clock::now() : Clock::time_point();
  const auto body_at = [this](int index) -> const Body& { return bodies_[static_cast<std::size_t>(index)]; };
  const Model& model = *kinds_[static_cast<std::size_t>(group.kind)].model;
  LaneWorkspace& scratch = *thread.of_kind[static_cast<std::size_t>(group.kind)];
  const auto scratch_of = [&](std::size_t lane) -> Workspace& {
    Workspace* const own = body_at(group.bodies[lane]).workspace;
    return own != nullptr ? *own : scratch.body(lane);
  };
  for (std::size_t l = 0; l < group.count; ++l) scratch_of(l).profile = profiled ? &thread.profile : nullptr;
  if (group.in_lanes) {
    step_lanes(group, next, scratch);
  } else {
    const Body& body = body_at(group.bodies[0]);
    *body.report = body.full != nullptr ? step_in_full_space(*body.full, model, *body.scene, *body.state, scratch_of(0),
                                                             *body.full_workspace)
                                        : runtime::step(model, *body.scene, *body.state, scratch_of(0));
  }
  for (std::size_t l = 0; observer != nullptr && l < group.count; ++l) {
    const Body& body = body_at(group.bodies[l]);
    observer->after_step(body.number, *body.report, scratch_of(l));
  }
  if (profiled) thread.seconds += std::chrono::duration<double>(Clock::now() - start).count();
}

/// Reads for the bodies of the next group are prefetched meanwhile.
void Crowd::step_lanes(const Group& group, const Group* next, LaneWorkspace& scratch) noexcept {
  std::array<LaneBody, kLanes> bodies, others;
  std::array<StepReport, kLanes> reports;
  const auto gather = [this](const Group& from, std::array<LaneBody, kLanes>& to) {
    for (std::size_t l = 0; l < from.count; ++l) {
      const Body& body = bodies_[static_cast<std::size_t>(from.bodies[l])];
      to[l] = {body.scene, body.state, body.workspace};
    }
    return std::span<const LaneBody>(to.data(), from.count);
  };
  step_in_lanes(*kinds_[static_cast<std::size_t>(group.kind)].model, gather(group, bodies), scratch,
                {reports.data(), group.count}, next != nullptr ? gather(*next, others) : std::span<const LaneBody>());
  for (std::size_t l = 0; l < group.count; ++l) *bodies_[static_cast<std::size_t>(group.bodies[l])].report = reports[l];
}

}  // namespace exmat::runtime
