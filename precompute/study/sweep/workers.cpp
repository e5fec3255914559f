#include "precompute/study/sweep/workers.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <fcntl.h>
#include <fmt/format.h>
#include <map>
#include <omp.h>
#include <string_view>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <system_error>
#include <unistd.h>
#include <utility>

#include "common/core/error.h"
#include "common/core/log.h"
#include "common/core/progress.h"

namespace exmat::precompute {
namespace {

constexpr std::size_t kLongestMessage = 4000;  // fits into a pipe that nobody reads yet

struct Child {
  std::size_t job = 0;
  int message = -1;  // descriptor to read what went wrong from
};

[[noreturn]] void fail(const char* what) {
  throw WorkError(fmt::format("cannot start a process: {}: {}", what, std::generic_category().message(errno)));
}

void write_message(int descriptor, std::string_view text) {
  text = text.substr(0, kLongestMessage);
  static_cast<void>(!::write(descriptor, text.data(), text.size()));
}

// In the child. exit() lets the solvers shut down.
[[noreturn]] void work(const Job& job, int descriptor, int threads) {
  ::prctl(PR_SET_PDEATHSIG, SIGTERM);
  log::set_sink({});
  set_progress_sink({});
  omp_set_num_threads(threads);
  int status = static_cast<int>(ExitStatus::kDone);
  try {
    job.work();
  } catch (const std::exception& error) {
    write_message(descriptor, error.what());
    status = static_cast<int>(ExitStatus::kFailure);
  }
  std::exit(status);
}

std::string read_message(int descriptor) {
  std::string text;
  std::array<char, 512> piece{};
  for (ssize_t size = 0; (size = ::read(descriptor, piece.data(), piece.size())) > 0;)
    text.append(piece.data(), static_cast<std::size_t>(size));
  ::close(descriptor);
  return text;
}

std::optional<std::string> failure_of(int wait_status, std::string message) {
  if (WIFSIGNALED(wait_status)) return fmt::format("ended by signal {}", WTERMSIG(wait_status));
  if (WEXITSTATUS(wait_status) == 0) return std::nullopt;
  return message.empty() ? fmt::format("ended with status {}", WEXITSTATUS(wait_status)) : std::move(message);
}

class Pool {
 public:
  Pool(const std::vector<Job>& jobs, int processes)
      : jobs_(jobs), threads_(std::max(1, omp_get_max_threads() / processes)), failures_(jobs.size()) {}

  void start(std::size_t job) {
    std::array<int, 2> ends{};
    if (::pipe2(ends.data(), O_CLOEXEC) != 0) fail("pipe");
    std::fflush(nullptr);
    const pid_t child = ::fork();
    if (child < 0) fail("fork");
    if (child == 0) {
      ::close(ends[0]);
      work(jobs_[job], ends[1], threads_);
    }
    ::close(ends[1]);
    children_[child] = {job, ends[0]};
  }

  void wait_for_one() {
    int wait_status = 0;
    const pid_t child = ::waitpid(-1, &wait_status, 0);
    if (child < 0 && errno != EINTR) fail("wait");
    const auto found = children_.find(child);
    if (found == children_.end()) return;
    const auto [job, message] = found->second;
    failures_[job] = failure_of(wait_status, read_message(message));
    if (failures_[job]) log::error(fmt::format("{}: {}", jobs_[job].name, *failures_[job]));
    children_.erase(found);
  }

  std::size_t running() const { return children_.size(); }
  std::vector<std::optional<std::string>> failures() { return std::move(failures_); }

 private:
  const std::vector<Job>& jobs_;
  int threads_;
  std::map<pid_t, Child> children_;
  std::vector<std::optional<std::string>> failures_;
};

}  // namespace

std::vector<std::optional<std::string>> run_in_processes(const std::string& stage, const std::vector<Job>& jobs,
                                                         int processes) {
  Pool pool(jobs, processes);
  Progress progress(stage, std::ssize(jobs));
  std::size_t next = 0;
  while (next < jobs.size() || pool.running() > 0) {
    while (next < jobs.size() && std::cmp_less(pool.running(), processes)) pool.start(next++);
    pool.wait_for_one();
    progress.reach(static_cast<std::int64_t>(next - pool.running()));
  }
  return pool.failures();
}

}  // namespace exmat::precompute
