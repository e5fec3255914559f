#pragma once

#include <ctime>

namespace exmat::benchmarks {

/// Processor time of this thread [s].
inline double thread_seconds() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

}  // namespace exmat::benchmarks
