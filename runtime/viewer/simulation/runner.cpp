#include "runtime/viewer/simulation/runner.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <utility>

namespace exmat::viewer {
namespace {

using Clock = std::chrono::steady_clock;

constexpr auto kRest = std::chrono::microseconds(1500);  // between two looks at the clock
constexpr double kMostOwed = 0.05;                       // [s] of real time; what is late beyond is given up
constexpr double kLongestTurn = 0.006;                   // [s] of real time, then others may have theirs
constexpr double kMemory = 0.3;                          // [s] of the measured speed

double seconds_since(Clock::time_point begin) { return std::chrono::duration<double>(Clock::now() - begin).count(); }

}  // namespace

Runner::Runner(Simulation& simulation) : simulation_(simulation) { publish(); }

Runner::~Runner() {
  stop_ = true;
  if (thread_.joinable()) thread_.join();
}

void Runner::start() {
  thread_ = std::thread([this] { run(); });
}

void Runner::run() {
  Clock::time_point last = Clock::now();
  while (!stop_) {
    std::this_thread::sleep_for(kRest);
    while (waiting_ > 0 && !stop_) std::this_thread::yield();
    const Clock::time_point now = Clock::now();
    const double seconds = std::chrono::duration<double>(now - last).count();
    last = now;
    const std::lock_guard lock(simulating_);
    take(seconds);
    if (seen_) publish();
  }
}

/// Whole steps of the time that has gone by.
std::int64_t Runner::owed_steps(double seconds) {
  if (paused_) return 0;
  owed_ = owed_ + seconds * speed_;
  const double time_step = simulation_.time_step();
  // Sums of frame times fall short of whole steps by rounding.
  const auto steps = static_cast<std::int64_t>(std::floor(owed_ / time_step + 1e-6));
  return std::max<std::int64_t>(steps, 0);
}

void Runner::take(double seconds) {
  owed_ = std::min(owed_, std::max(kMostOwed * speed_, simulation_.time_step()));
  std::int64_t steps = owed_steps(seconds);
  const Clock::time_point begin = Clock::now();
  std::int64_t taken = 0;
  while (steps > 0 && seconds_since(begin) < kLongestTurn) {
    const std::int64_t some = std::min<std::int64_t>(steps, 4);
    simulation_.advance(some);
    steps -= some;
    taken += some;
  }
  const double simulated = static_cast<double>(taken) * simulation_.time_step();
  owed_ -= simulated;
  const double share = 1 - std::exp(-seconds / kMemory);
  if (seconds > 0) lately_ += share * (simulated / seconds - lately_);
}

void Runner::advance(double seconds) {
  const std::lock_guard lock(simulating_);
  const std::int64_t steps = owed_steps(seconds);
  simulation_.advance(steps);
  owed_ -= static_cast<double>(steps) * simulation_.time_step();
  lately_ = paused_ ? 0 : speed_.load();
  publish();
}

void Runner::step(std::int64_t steps) {
  with([&](Simulation& simulation) {
    simulation.advance(steps);
    publish();
  });
}

void Runner::set_request(const SnapshotRequest& request) {
  with([&](Simulation&) { request_ = request; });
}

void Runner::refresh() {
  with([&](Simulation&) { publish(); });
}

void Runner::publish() {
  auto snapshot = std::make_shared<Snapshot>(simulation_.snapshot(request_));
  snapshot->paused = paused_;
  snapshot->speed = lately_;
  const std::lock_guard lock(front_);
  unseen_ += snapshot->times;
  seen_ = false;
  latest_ = std::move(snapshot);
}

std::shared_ptr<const Snapshot> Runner::latest() {
  const std::lock_guard lock(front_);
  seen_ = true;
  return latest_;
}

StepTimes Runner::take_times() {
  const std::lock_guard lock(front_);
  return std::exchange(unseen_, StepTimes{});
}

}  // namespace exmat::viewer
