#include "precompute/solvers/available_memory.h"

#include <algorithm>
#include <fstream>
#include <limits>
#include <string>
#include <sys/resource.h>
#include <unistd.h>

namespace exmat::precompute {
namespace {

constexpr std::int64_t kMost = std::numeric_limits<std::int64_t>::max();

// Memory of the whole system, "MemAvailable:  123456 kB"; all it has where that is not told.
std::int64_t of_system() {
  std::ifstream file("/proc/meminfo");
  for (std::string name; file >> name;) {
    std::int64_t kilobytes = 0;
    std::string unit;
    if (name == "MemAvailable:" && file >> kilobytes) return 1024 * kilobytes;
    std::getline(file, unit);
  }
  return sysconf(_SC_PHYS_PAGES) * sysconf(_SC_PAGESIZE);
}

// Rest of the limit of the address space.
std::int64_t of_limit() {
  rlimit limit{};
  if (getrlimit(RLIMIT_AS, &limit) != 0 || limit.rlim_cur == RLIM_INFINITY) return kMost;
  std::int64_t pages = 0;
  std::ifstream("/proc/self/statm") >> pages;
  return std::max<std::int64_t>(0, static_cast<std::int64_t>(limit.rlim_cur) - pages * sysconf(_SC_PAGESIZE));
}

}  // namespace

std::int64_t available_memory() { return std::min(of_system(), of_limit()); }

}  // namespace exmat::precompute
