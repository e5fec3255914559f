#include "common/core/thread_team.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <exception>
#include <limits>
#include <mutex>
#include <new>
#include <thread>
#include <vector>

#if defined(__x86_64__)
#include <immintrin.h>
#endif
#ifdef __linux__
#include <sched.h>
#endif
#ifndef _WIN32
#include <pthread.h>
#endif

namespace exmat {
namespace {

constexpr std::chrono::microseconds kSpin{20};
constexpr int kLooksAtOnce = 16;  // between two looks at the clock

void relax() noexcept {
#if defined(__x86_64__)
  _mm_pause();
#endif
}

/// Waits until `value` is another than `old`: it spins for a while, then it sleeps.
void wait_for_change(const std::atomic<std::uint32_t>& value, std::uint32_t old) noexcept {
  const auto end = std::chrono::steady_clock::now() + kSpin;
  while (std::chrono::steady_clock::now() < end)
    for (int look = 0; look < kLooksAtOnce; ++look) {
      if (value.load(std::memory_order_acquire) != old) return;
      relax();
    }
  value.wait(old, std::memory_order_acquire);
}

/// Does what is left of a loop of which `next` is not begun.
void take_shares(const SharedLoop& loop, std::atomic<std::size_t>& next, std::size_t thread) noexcept {
  for (;;) {
    const std::size_t begin = next.fetch_add(loop.share, std::memory_order_relaxed);
    if (begin >= loop.count) return;
    const std::size_t end = std::min(begin + loop.share, loop.count);
    for (std::size_t i = begin; i < end; ++i) loop.call(loop.work, i, thread);
  }
}

/// Threads that wait for loops. The gate counts who is inside the present loop, and has a bit that says whether more
/// may enter; it is closed once the caller finds nothing left to do.
class Team {
 public:
  /// Starts as many as the system allows.
  void grow(std::size_t workers) noexcept {
    try {
      while (threads_.size() < std::min(workers, most_))
        threads_.emplace_back([this, number = threads_.size() + 1] { serve(number); });
    } catch (const std::exception&) {  // no memory, or no thread: those that there are will do
      most_ = threads_.size();
    }
  }

  void run(const SharedLoop& loop) noexcept {
    loop_ = loop;
    next_.store(0, std::memory_order_relaxed);
    gate_.store(kOpen, std::memory_order_release);
    round_.fetch_add(1, std::memory_order_release);
    round_.notify_all();
    work(0);
    std::uint32_t inside = gate_.fetch_and(~kOpen, std::memory_order_acq_rel) & ~kOpen;
    while (inside != 0) {
      wait_for_change(gate_, inside);
      inside = gate_.load(std::memory_order_acquire);
    }
  }

 private:
  static constexpr std::uint32_t kOpen = 1U << 31U;

  [[noreturn]] void serve(std::size_t number) noexcept {
    for (std::uint32_t round = 0;; round = round_.load(std::memory_order_acquire)) {
      if (enter()) {
        if (number < loop_.threads) work(number);
        if (gate_.fetch_sub(1, std::memory_order_acq_rel) == 1) gate_.notify_one();
      }
      wait_for_change(round_, round);
    }
  }

  bool enter() noexcept {
    std::uint32_t gate = gate_.load(std::memory_order_relaxed);
    while ((gate & kOpen) != 0)
      if (gate_.compare_exchange_weak(gate, gate + 1, std::memory_order_acquire, std::memory_order_relaxed))
        return true;
    return false;
  }

  void work(std::size_t thread) noexcept { take_shares(loop_, next_, thread); }

  SharedLoop loop_{};
  std::vector<std::thread> threads_;
  std::size_t most_ = std::numeric_limits<std::size_t>::max();
  // On cache lines of their own.
  alignas(128) std::atomic<std::uint32_t> round_ = 0;
  alignas(128) std::atomic<std::uint32_t> gate_ = 0;
  alignas(128) std::atomic<std::size_t> next_ = 0;
};

/// Teams that nobody uses now. They live as long as the process: their threads sleep. A child of fork() has no threads
/// but the one that called it, so it forgets them.
class Teams {
 public:
  static Teams& all() noexcept {
    alignas(Teams) static std::array<unsigned char, sizeof(Teams)> place;
    static Teams* const teams = new (place.data()) Teams;
    return *teams;
  }

  /// Null where there is no memory for one.
  Team* take() noexcept {
    const std::lock_guard lock(mutex_);
    if (!free_.empty()) {
      Team* const team = free_.back();
      free_.pop_back();
      return team;
    }
    try {
      free_.reserve(++made_);  // so that give_back() allocates nothing
      return new Team;
    } catch (const std::bad_alloc&) {
      return nullptr;
    }
  }

  void give_back(Team* team) noexcept {
    const std::lock_guard lock(mutex_);
    free_.push_back(team);
  }

 private:
  Teams() {
#ifndef _WIN32  // which has no fork()
    pthread_atfork([] { all().mutex_.lock(); }, [] { all().mutex_.unlock(); },
                   [] {
                     all().free_.clear();
                     all().mutex_.unlock();
                   });
#endif
  }

  std::mutex mutex_;
  std::vector<Team*> free_;
  std::size_t made_ = 0;
};

Scheduler host;

// The caller does what the host has left when it returns.
void run_on_host(const SharedLoop& loop) noexcept {
  struct Shared {
    const SharedLoop& loop;
    std::atomic<std::size_t> next{0};
  } shared{loop};
  const auto task = [](void* data, std::int32_t thread) {
    auto& [own, next] = *static_cast<Shared*>(data);
    const auto number = static_cast<std::size_t>(thread);
    if (number < own.threads) take_shares(own, next, number);
  };
  host.run(host.user, task, &shared, static_cast<std::int32_t>(loop.threads));
  task(&shared, 0);
}

}  // namespace

void set_scheduler(const Scheduler& scheduler) noexcept { host = scheduler; }

void run_shared(const SharedLoop& loop) noexcept {
  if (host.run != nullptr) return run_on_host(loop);
  Team* const team = Teams::all().take();
  if (team == nullptr) {
    for (std::size_t i = 0; i < loop.count; ++i) loop.call(loop.work, i, 0);
    return;
  }
  team->grow(loop.threads - 1);
  team->run(loop);
  Teams::all().give_back(team);
}

int processor_count() noexcept {
#ifdef __linux__
  cpu_set_t allowed;
  if (sched_getaffinity(0, sizeof allowed, &allowed) == 0) return std::max(1, CPU_COUNT(&allowed));
#endif
  return static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));
}

}  // namespace exmat
