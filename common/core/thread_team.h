#pragma once

#include <cstddef>
#include <cstdint>

namespace exmat {

/// A loop over i < count that threads share: call(work, i, thread) for each i once, `share` of them at a time.
struct SharedLoop {
  void (*call)(const void* work, std::size_t i, std::size_t thread) noexcept;
  const void* work;
  std::size_t count, share;
  std::size_t threads;  ///< at most, the caller among them; numbered from 0, the caller's number
};

/// A host's threads, in place of those of the process: run() calls task(data, i) once for each i < count, at the same
/// time where it can, and returns when all have returned.
struct Scheduler {
  void (*run)(void* user, void (*task)(void* data, std::int32_t i), void* data, std::int32_t count) = nullptr;
  void* user = nullptr;
};

/// Serves all loops from then on; without run() the process's own threads do. Not while a loop runs.
void set_scheduler(const Scheduler& scheduler) noexcept;

/// Returns when all are done. Threads that cannot be started, or come too late because the machine is busy, are done
/// without: the caller waits for those alone that have begun. Threads that wait spin for 20 us, then they sleep. A
/// child of fork() has threads of its own.
void run_shared(const SharedLoop& loop) noexcept;

/// Number of processors that this process may run on at once, at least 1.
int processor_count() noexcept;

/// Calls work(i, thread) for i < count, each once, likewise. One thread alone costs nothing.
template <class Work>
void by_threads(std::size_t count, int threads, std::size_t share, const Work& work) noexcept {
  if (threads <= 1 || count < 2) {
    for (std::size_t i = 0; i < count; ++i) work(i, std::size_t{0});
    return;
  }
  const auto call = [](const void* its_work, std::size_t i, std::size_t thread) noexcept {
    (*static_cast<const Work*>(its_work))(i, thread);
  };
  run_shared({call, &work, count, share, static_cast<std::size_t>(threads)});
}

}  // namespace exmat
