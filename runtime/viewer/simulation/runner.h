#pragma once

#include <atomic>
#include <condition_variable>
#include <memory>
#include <mutex>
#include <thread>

#include "runtime/viewer/simulation/simulation.h"

namespace exmat::viewer {

/// Steps a simulation, in real time in a thread of its own, or by hand with a clock of its own. What is drawn is the
/// latest snapshot; what changes the simulation takes turns with its steps.
class Runner {
 public:
  explicit Runner(Simulation& simulation);
  ~Runner();
  Runner(const Runner&) = delete;
  Runner& operator=(const Runner&) = delete;

  /// From now on in real time.
  void start();

  /// By `seconds` of a clock in which nothing else happens; not after start().
  void advance(double seconds);

  void set_paused(bool paused) { paused_ = paused; }
  bool paused() const { return paused_; }
  /// Simulated over real time, > 0.
  void set_speed(double speed) { speed_ = speed; }
  double speed() const { return speed_; }
  /// So many steps, also while paused.
  void step(std::int64_t steps);

  void set_request(const SnapshotRequest& request);

  /// Never null.
  std::shared_ptr<const Snapshot> latest();
  /// Times of all steps since the last call.
  StepTimes take_times();

  /// Runs action(simulation) between two steps.
  template <typename Action>
  decltype(auto) with(Action&& action) {
    ++waiting_;
    const std::lock_guard lock(simulating_);
    --waiting_;
    return action(simulation_);
  }
  /// A new snapshot after something was changed while nothing is stepped.
  void refresh();

 private:
  void run();
  void take(double seconds);
  std::int64_t owed_steps(double seconds);
  void publish();

  Simulation& simulation_;
  std::mutex simulating_;
  std::atomic<int> waiting_ = 0;
  std::atomic<bool> paused_ = false, stop_ = false;
  std::atomic<double> speed_ = 1;
  SnapshotRequest request_;
  double owed_ = 0;    // simulated time that is to be stepped [s]
  double lately_ = 1;  // simulated over real time
  std::atomic<bool> seen_ = true;
  std::mutex front_;  // of latest_ and unseen_
  StepTimes unseen_;
  std::shared_ptr<const Snapshot> latest_;
  std::thread thread_;
};

}  // namespace exmat::viewer
