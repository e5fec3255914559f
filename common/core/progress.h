#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <string>

namespace exmat {

/// One report of a running stage.
struct ProgressReport {
  std::string stage;
  std::int64_t done = 0;
  std::int64_t total = 0;         ///< 0 where it is not known
  double elapsed_seconds = 0;     ///< since the stage began
  double remaining_seconds = -1;  ///< estimate; negative while unknown
  bool finished = false;
};

/// Receives reports, where a stage begins and ends and at most a few a second between; set it in main. Without one,
/// reports are dropped.
using ProgressSink = std::function<void(const ProgressReport&)>;
void set_progress_sink(ProgressSink sink);

/// Progress of one stage: construct where it begins, advance as work is done, destroy where it ends. Call from one
/// thread at a time.
class Progress {
 public:
  Progress(std::string stage, std::int64_t total);
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  void advance(std::int64_t count = 1) { reach(done_ + count); }
  /// Sets what is done of the total.
  void reach(std::int64_t done);

 private:
  using Clock = std::chrono::steady_clock;
  void report(bool finished);

  std::string stage_;
  std::int64_t total_;
  std::int64_t done_ = 0;
  Clock::time_point start_;
  Clock::time_point last_report_;
};

}  // namespace exmat
