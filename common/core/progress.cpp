#include "common/core/progress.h"

#include <utility>

namespace exmat {
namespace {

constexpr std::chrono::milliseconds kReportInterval{500};

ProgressSink& sink() {
  static ProgressSink current;
  return current;
}

}  // namespace

void set_progress_sink(ProgressSink new_sink) { sink() = std::move(new_sink); }

Progress::Progress(std::string stage, std::int64_t total)
    : stage_(std::move(stage)), total_(total), start_(Clock::now()), last_report_(start_) {
  report(false);
}

Progress::~Progress() { report(true); }

void Progress::reach(std::int64_t done) {
  done_ = done;
  const auto now = Clock::now();
  if (now - last_report_ < kReportInterval) return;
  last_report_ = now;
  report(false);
}

void Progress::report(bool finished) {
  if (!sink()) return;
  const double elapsed = std::chrono::duration<double>(Clock::now() - start_).count();
  const bool known = total_ > 0 && done_ > 0;
  const double remaining = known ? elapsed * static_cast<double>(total_ - done_) / static_cast<double>(done_) : -1.0;
  sink()({stage_, done_, total_, elapsed, remaining, finished});
}

}  // namespace exmat
