#include "runtime/api/startable_threads.h"

#include <algorithm>
#include <atomic>
#include <exception>
#include <omp.h>
#include <thread>
#include <vector>

namespace exmat::runtime {
namespace {

/// Starts up to `wanted` threads that live at the same time, and ends them; how many did.
int start_at_once(int wanted) noexcept {
  std::atomic_flag end = ATOMIC_FLAG_INIT;
  std::vector<std::thread> threads;
  try {
    threads.reserve(static_cast<std::size_t>(wanted));
    for (int i = 0; i < wanted; ++i) threads.emplace_back([&end] { end.wait(false); });
  } catch (const std::exception&) {  // no memory, or no thread: those that there are will do
  }
  end.test_and_set();
  end.notify_all();
  for (std::thread& thread : threads) thread.join();
  return static_cast<int>(threads.size());
}

}  // namespace

int startable_threads(int wanted) noexcept {
  thread_local int proven = 1;
  const int most = std::min(wanted, omp_get_num_procs());
  if (most <= proven) return most;
  const int started = start_at_once(most - 1);
  // A system at its limit needs what the last threads would have taken.
  proven = 1 + (started == most - 1 ? started : started / 2);
  return proven;
}

}  // namespace exmat::runtime
