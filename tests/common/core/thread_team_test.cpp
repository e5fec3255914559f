#include "common/core/thread_team.h"

#include <array>
#include <atomic>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <thread>
#include <unistd.h>
#include <vector>

namespace exmat {
namespace {

/// Number of calls of each i by a thread whose number is below `threads`.
std::vector<int> calls(std::size_t count, int threads, std::size_t share) {
  std::vector<int> calls(count);
  by_threads(count, threads, share, [&](std::size_t i, std::size_t thread) {
    if (thread < static_cast<std::size_t>(threads)) ++calls[i];
  });
  return calls;
}

TEST(ThreadTeam, CallsEachOnce) {
  for (const std::size_t count : {0, 1, 2, 7, 1000})
    for (const int threads : {1, 2, 3, 16, 2})
      for (const std::size_t share : {1, 4, 5000})
        for (int round = 0; round < 20; ++round)
          ASSERT_EQ(calls(count, threads, share), std::vector<int>(count, 1)) << count << ' ' << threads;
}

/// Tasks one after another, the last one first; or each on a thread of its own.
void run_backwards(void* user, void (*task)(void*, std::int32_t), void* data, std::int32_t count) {
  ++*static_cast<int*>(user);
  for (std::int32_t i = count; i-- > 0;) task(data, i);
}
void run_on_new_threads(void* user, void (*task)(void*, std::int32_t), void* data, std::int32_t count) {
  ++*static_cast<int*>(user);
  std::vector<std::thread> threads;
  for (std::int32_t i = 0; i < count; ++i) threads.emplace_back(task, data, i);
  for (std::thread& thread : threads) thread.join();
}

/// A host that calls none of its tasks, and one that calls some that it was not given.
void run_nothing(void* user, void (* /*task*/)(void*, std::int32_t), void* /*data*/, std::int32_t /*count*/) {
  ++*static_cast<int*>(user);
}
void run_others(void* user, void (*task)(void*, std::int32_t), void* data, std::int32_t count) {
  ++*static_cast<int*>(user);
  for (const std::int32_t i : {-1, count, count + 1, 1}) task(data, i);
}

TEST(ThreadTeam, RunsOnThreadsOfAHost) {
  for (const auto run : {run_backwards, run_on_new_threads, run_nothing, run_others}) {
    int runs = 0;
    set_scheduler({run, &runs});
    for (const std::size_t count : {2, 7, 1000})
      for (const std::size_t share : {1, 4, 5000})
        EXPECT_EQ(calls(count, 3, share), std::vector<int>(count, 1)) << count;
    EXPECT_EQ(runs, 9);
    EXPECT_EQ(calls(1000, 1, 4), std::vector<int>(1000, 1));
    EXPECT_EQ(runs, 9) << "one thread alone asks nobody";
    set_scheduler({});
    EXPECT_EQ(calls(1000, 3, 4), std::vector<int>(1000, 1));
    EXPECT_EQ(runs, 9);
  }
}

TEST(ThreadTeam, ThreadsTakePart) {
  std::atomic<int> inside = 0;
  // Each call waits for the other.
  by_threads(2, 2, 1, [&](std::size_t, std::size_t) {
    ++inside;
    while (inside < 2) std::this_thread::yield();
  });
  EXPECT_EQ(inside, 2);
}

TEST(ThreadTeam, SeveralCallersHaveTeamsOfTheirOwn) {
  std::array<std::vector<int>, 4> totals;
  std::vector<std::thread> callers;
  callers.reserve(totals.size());
  for (auto& total : totals)
    callers.emplace_back([&total] {
      total.assign(100, 0);
      for (int round = 0; round < 200; ++round) {
        const std::vector<int> once = calls(100, 3, 2);
        for (std::size_t i = 0; i < 100; ++i) total[i] += once[i];
      }
    });
  for (std::thread& caller : callers) caller.join();
  for (const auto& total : totals) EXPECT_EQ(total, std::vector<int>(100, 200));
}

TEST(ThreadTeam, AChildOfForkHasThreadsOfItsOwn) {
  calls(100, 3, 1);
  const pid_t child = fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    alarm(60);  // it would wait for ever for threads that it does not have
    _exit(calls(1000, 3, 1) == std::vector<int>(1000, 1) && calls(1000, 2, 1) == std::vector<int>(1000, 1) ? 0 : 1);
  }
  int status = -1;
  ASSERT_EQ(waitpid(child, &status, 0), child);
  EXPECT_EQ(status, 0);
  EXPECT_EQ(calls(1000, 3, 1), std::vector<int>(1000, 1));
}

TEST(ThreadTeam, ThereIsAProcessor) { EXPECT_GE(processor_count(), 1); }

}  // namespace
}  // namespace exmat
