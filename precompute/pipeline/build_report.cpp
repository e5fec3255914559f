#include "precompute/pipeline/build_report.h"

#include <sys/resource.h>

namespace exmat::precompute {

std::int64_t peak_memory_bytes() {
  constexpr std::int64_t kUnit = 1024;  // of ru_maxrss on Linux
  rusage usage{};
  return getrusage(RUSAGE_SELF, &usage) == 0 ? kUnit * usage.ru_maxrss : 0;
}

}  // namespace exmat::precompute
