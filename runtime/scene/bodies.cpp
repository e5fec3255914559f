#include "runtime/scene/bodies.h"

#include <algorithm>
#include <array>
#include <omp.h>
#include <utility>

#include "common/core/timer.h"
#include "runtime/scene/contact_load.h"
#include "runtime/sim/step/sleep.h"

namespace exmat::runtime {
namespace {

/// Scratch that one thread needs at once.
std::size_t workspaces(int count) {
  return count < kFewestLanes ? 1 : static_cast<std::size_t>(std::min<std::ptrdiff_t>(count, kLanes));
}

}  // namespace

Bodies::Bodies(const Model& model, StepScene scene, State start, int count, SceneKeys keys)
    : model_(model),
      scene_(std::move(scene)),
      keys_(std::move(keys)),
      start_(std::move(start)),
      reports_(static_cast<std::size_t>(count)),
      threads_(static_cast<std::size_t>(std::min(count, omp_get_max_threads())),
               Thread{{model, scene_, workspaces(count)}, {}}) {
  keys_.apply_start(model, scene_);
  refresh_weights(model, scene_, start_, threads_.front().workspace.body(0));
  states_.assign(reports_.size(), start_);
}

void add_to_hash(const Model& model, const State& state, FnvHash& hash) {
  hash.add_all(state.q);
  hash.add_all(state.v);
  hash.add_all(model.frame->coordinates(state.frame));
}

void Bodies::restart() {
  for (State& state : states_) state = start_;
}

/// The groups of one thread: a contiguous share, which depends on the number of threads and on nothing else.
void Bodies::step_share(int thread) noexcept {
  const std::size_t size = side_by_side_ ? kLanes : 1, groups = (states_.size() + size - 1) / size;
  const std::size_t first = groups * static_cast<std::size_t>(thread) / threads_.size();
  const std::size_t last = groups * static_cast<std::size_t>(thread + 1) / threads_.size();
  const auto begin_of = [&](std::size_t group) { return std::min(group * size, states_.size()); };
  for (std::size_t group = first; group < last; ++group)
    step_group(begin_of(group), begin_of(group + 1), begin_of(last), threads_[static_cast<std::size_t>(thread)]);
}

/// The same where bodies may sleep: groups are made of those that are awake. Those of a last group that is too small
/// for lanes step by themselves whoever is awake, so that nobody's results depend on that.
void Bodies::step_share_awake(int thread) noexcept {
  Thread& own = threads_[static_cast<std::size_t>(thread)];
  const std::size_t rest = states_.size() % kLanes, in_lanes = states_.size() - (rest < kFewestLanes ? rest : 0);
  const std::size_t first = in_lanes * static_cast<std::size_t>(thread) / threads_.size();
  const std::size_t last = in_lanes * static_cast<std::size_t>(thread + 1) / threads_.size();
  std::array<std::size_t, kLanes> awake{};
  std::size_t count = 0;
  for (std::size_t body = first; body < last; ++body) {
    if (sleeps(model_, scene_, states_[body]))
      reports_[body] = sleep_through(scene_, states_[body]);
    else
      awake[count++] = body;
    if (count == kLanes || (count > 0 && body + 1 == last)) {
      step_awake(std::span(awake).first(count), own);
      count = 0;
    }
  }
  if (thread + 1 == threads() && in_lanes < states_.size()) step_group(in_lanes, states_.size(), states_.size(), own);
}

void Bodies::step_awake(std::span<const std::size_t> awake, Thread& thread) noexcept {
  const Timer timer;
  std::array<LaneBody, kLanes> bodies;
  std::array<StepReport, kLanes> reports;
  for (std::size_t lane = 0; lane < awake.size(); ++lane) bodies[lane] = {&scene_, &states_[awake[lane]]};
  step_in_lanes(model_, {bodies.data(), awake.size()}, thread.workspace, {reports.data(), awake.size()});
  for (std::size_t lane = 0; lane < awake.size(); ++lane) reports_[awake[lane]] = reports[lane];
  if (thread.workspace.body(0).profile == nullptr) return;
  thread.measured.seconds += timer.seconds();
  for (const std::size_t body : awake) thread.measured.work += step_work(model_, scene_, reports_[body]);
}

void Bodies::step_group(std::size_t first, std::size_t last, std::size_t end_of_share, Thread& thread) noexcept {
  const Timer timer;
  if (side_by_side_) {
    std::array<LaneBody, kLanes> bodies;
    std::array<LaneBody, kLanes> next;
    for (std::size_t body = first; body < last; ++body) bodies[body - first] = {&scene_, &states_[body]};
    const std::size_t others = std::min(end_of_share - last, next.size());
    for (std::size_t other = 0; other < others; ++other) next[other] = {&scene_, &states_[last + other]};
    step_side_by_side(model_, {bodies.data(), last - first}, thread.workspace,
                      std::span(reports_).subspan(first, last - first), {next.data(), others});
  } else {
    reports_[first] = runtime::step(model_, scene_, states_[first], thread.workspace.body(0));
  }
  if (thread.workspace.body(0).profile == nullptr) return;
  thread.measured.seconds += timer.seconds();
  for (std::size_t body = first; body < last; ++body) thread.measured.work += step_work(model_, scene_, reports_[body]);
}

std::span<const StepReport> Bodies::step() noexcept {
  const int threads = this->threads();
  keys_.apply(model_, states_.front().step, scene_);
  side_by_side_ = count() >= kFewestLanes && can_step_side_by_side(model_, scene_);
  const auto step_share_of = [&](int thread) {
    if (side_by_side_ && scene_.sleep.energy > 0)
      step_share_awake(thread);
    else
      step_share(thread);
  };
  if (threads == 1) {
    step_share_of(0);
    return reports_;
  }
#pragma omp parallel for schedule(static, 1) num_threads(threads)
  for (int thread = 0; thread < threads; ++thread) step_share_of(thread);
  return reports_;
}

std::optional<int> Bodies::first_non_finite() const {
  for (int body = 0; body < count(); ++body)
    if ((reports_[static_cast<std::size_t>(body)].status & kStepNonFinite) != 0) return body;
  return std::nullopt;
}

void Bodies::add_contact_load(Eigen::VectorXd& load) const {
  runtime::add_contact_load(model_, states_.front(), threads_.front().workspace.body(0), load);
}

std::uint64_t Bodies::hash() const {
  FnvHash hash;
  for (const State& state : states_) add_to_hash(model_, state, hash);
  return hash.value();
}

void Bodies::set_profiled(bool profiled) {
  for (Thread& thread : threads_) thread.workspace.set_profile(profiled ? &thread.measured.profile : nullptr);
}

Bodies::Measured Bodies::take_measured() {
  Measured sum;
  for (Thread& thread : threads_) {
    for (std::size_t stage = 0; stage < kStageNames.size(); ++stage) {
      sum.profile.seconds[stage] += thread.measured.profile.seconds[stage];
      sum.profile.flops[stage] += thread.measured.profile.flops[stage];
    }
    sum.seconds += thread.measured.seconds;
    sum.work += thread.measured.work;
    thread.measured = {};
  }
  return sum;
}

}  // namespace exmat::runtime
