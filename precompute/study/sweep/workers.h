#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace exmat::precompute {

struct Job {
  std::string name;
  std::function<void()> work;  ///< leaves what it did in files; throws what went wrong
};

/// Runs each job in a process of its own, at most so many at a time, since PETSc is not safe for threads; they share
/// the OpenMP threads and log nothing. Reports progress as `stage`. What went wrong with each job: nothing where all
/// went well. To be called before anything of PETSc or OpenMP has run in this process.
std::vector<std::optional<std::string>> run_in_processes(const std::string& stage, const std::vector<Job>& jobs,
                                                         int processes);

}  // namespace exmat::precompute
