#include "precompute/solvers/ranks.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdlib>
#include <dlfcn.h>
#include <filesystem>
#include <malloc.h>
#include <map>
#include <memory>
#include <new>
#include <string>
#include <string_view>
#include <sys/resource.h>
#include <system_error>
#include <thread>

#include "common/core/command_files.h"
#include "precompute/solvers/solver_access.h"
#include "precompute/solvers/team.h"

// Needs what PETSc's other headers declare.
#include <petscblaslapack.h>

namespace exmat::precompute {
namespace {

// Between looks for the leader's next call; a solve takes longer.
constexpr std::chrono::milliseconds kNap{1};

struct Ranks {
  MPI_Comm team = PETSC_COMM_SELF;
  int size = 1, rank = 0;
};

Ranks& ranks() {
  static Ranks current;
  return current;
}

SolverSettings& settings() {
  static SolverSettings current;
  return current;
}

void broadcast(std::string& text) {
  auto size = static_cast<int>(text.size());
  MPI_Bcast(&size, 1, MPI_INT, 0, team());
  text.resize(static_cast<std::size_t>(size));
  MPI_Bcast(text.data(), size, MPI_CHAR, 0, team());
}

// The leader's settings, to all ranks, in place of what they had.
void share_settings(const Call& call, const SolverSettings& wanted) {
  agree([&] {
    for (const auto& [name, value] : settings().options)
      check_petsc(PetscOptionsClearValue(nullptr, ("-" + name).c_str()), "option");
    settings() = wanted;
    settings().eigensolver = static_cast<Eigensolver>(call.numbers[0]);
    settings().options.resize(static_cast<std::size_t>(call.numbers[1]));
    for (auto& [name, value] : settings().options) {
      if (rank_count() > 1) broadcast(name), broadcast(value);
      check_petsc(PetscOptionsSetValue(nullptr, ("-" + name).c_str(), value.empty() ? nullptr : value.c_str()),
                  "option");
    }
  });
}

std::int64_t largest_peak_memory() {
  constexpr std::int64_t kUnit = 1024;  // of ru_maxrss on Linux
  rusage usage{};
  std::int64_t peak = getrusage(RUSAGE_SELF, &usage) == 0 ? kUnit * usage.ru_maxrss : 0;
  if (rank_count() > 1) MPI_Allreduce(MPI_IN_PLACE, &peak, 1, MPI_INT64_T, MPI_MAX, team());
  return peak;
}

Call next_call() {
  Call call;
  MPI_Request request = MPI_REQUEST_NULL;
  MPI_Ibcast(&call, sizeof call, MPI_BYTE, 0, team(), &request);
  for (int here = 0; here == 0;) {
    MPI_Test(&request, &here, MPI_STATUS_IGNORE);
    if (here == 0) std::this_thread::sleep_for(kNap);
  }
  return call;
}

using Shares = std::map<std::int64_t, std::unique_ptr<Share>>;

template <typename Kind>
Kind& find(const Shares& shares, std::int64_t id) {
  return dynamic_cast<Kind&>(*shares.at(id));
}

void do_share(const Call& call, Shares& shares) {
  switch (call.task) {
    case Task::kForget:
      shares.erase(call.object);
      return;
    case Task::kPeakMemory:
      largest_peak_memory();
      return;
    case Task::kConfigure:
      share_settings(call, {});
      return;
    case Task::kFactorise: {
      auto share = std::make_unique<SolverShare>(call);
      SolverShare& made = *share;
      shares[call.object] = std::move(share);
      made.factorise({}, {}, {});
      return;
    }
    case Task::kSolve:
      find<SolverShare>(shares, call.object).solve({}, call.numbers[0]);
      return;
    case Task::kPoseEigenproblem: {
      auto share = std::make_unique<EigenShare>(call, find<SolverShare>(shares, call.numbers[0]));
      EigenShare& made = *share;
      shares[call.object] = std::move(share);
      made.pose({}, {});
      return;
    }
    case Task::kSearch:
      find<EigenShare>(shares, call.object).search({}, call.numbers[0], call.numbers[1]);
      return;
    case Task::kStop:
      return;
  }
}

// Work of a rank other than the leader. Returns the exit status of the program.
int serve() {
  Shares shares;
  for (;;) {
    const Call call = next_call();
    if (call.task == Task::kStop) return static_cast<int>(call.numbers[0]);
    try {
      do_share(call, shares);
    } catch (const WorkError&) {  // thrown on all ranks; the leader's program says it
    }
  }
}

// Open MPI, MPICH and what else speaks PMI.
bool started_by_mpirun() {
  for (const char* name : {"OMPI_COMM_WORLD_SIZE", "PMI_SIZE", "PMIX_RANK"})
    if (std::getenv(name) != nullptr) return true;
  return false;
}

// A single process needs no daemon, no binding, no network, and nothing that others share: neither a folder in the
// temporary directory, which Open MPI's processes remove under each other, nor shared memory. mpirun sets its own. Nor
// does it wait for anybody: each look for messages would give the processor away, and on a busy machine not be given it
// back for some milliseconds.
void set_environment() {
  setenv("HWLOC_HIDE_ERRORS", "2", 0);  // stderr is for the log, also in containers without /sys
  if (started_by_mpirun()) {
    setenv("OMPI_MCA_mpi_yield_when_idle", "1", 0);  // ranks may be more than cores
    return;
  }
  setenv("OMPI_MCA_mpi_yield_when_idle", "0", 0);
  setenv("OMPI_MCA_ess_singleton_isolated", "1", 0);
  setenv("OMPI_MCA_hwloc_base_binding_policy", "none", 0);
  setenv("OMPI_MCA_btl", "self", 0);
  setenv("OMPI_MCA_shmem", "mmap", 0);  // the other kinds try themselves out in /dev/shm
  setenv("OMPI_MCA_orte_create_session_dirs", "0", 0);
}

// Keeps the text of the first error for check_petsc, which throws it once the call has returned.
PetscErrorCode remember_error(MPI_Comm, int, const char*, const char*, PetscErrorCode code, PetscErrorType type,
                              const char* message, void*) {
  if (type == PETSC_ERROR_INITIAL) last_petsc_message() = message;
  return code;
}

template <typename Function>
Function function_of_blas(const char* name) {
  return reinterpret_cast<Function>(dlsym(RTLD_DEFAULT, name));
}

// OpenBLAS's kernels for the instructions of this processor, or null.
const char* kernels_of_processor() {
#if defined(__x86_64__)
  const bool avx512 = __builtin_cpu_supports("avx512f") != 0 && __builtin_cpu_supports("avx512cd") != 0 &&
                      __builtin_cpu_supports("avx512bw") != 0 && __builtin_cpu_supports("avx512dq") != 0 &&
                      __builtin_cpu_supports("avx512vl") != 0;
  if (avx512) return "SkylakeX";
  if (__builtin_cpu_supports("avx2") != 0 && __builtin_cpu_supports("fma") != 0) return "Haswell";
#endif
  return nullptr;
}

// OpenBLAS knows processors by their model numbers, and takes kernels of twenty years ago, a quarter as fast, for those
// that are newer than itself. Nothing is computed yet: it may choose once more.
void choose_blas_kernels() {
  constexpr const char* kUnknown = "Prescott";
  constexpr const char* kChoice = "OPENBLAS_CORETYPE";
  const auto name = function_of_blas<char* (*)()>("openblas_get_corename");
  const auto leave = function_of_blas<void (*)()>("gotoblas_dynamic_quit");
  const auto choose = function_of_blas<void (*)()>("gotoblas_dynamic_init");
  if (name == nullptr || leave == nullptr || choose == nullptr || std::getenv(kChoice) != nullptr) return;
  const char* kernels = kernels_of_processor();
  if (kernels == nullptr || std::string_view(name()) != kUnknown) return;
  setenv(kChoice, kernels, 0);
  leave();
  choose();
}

// OpenBLAS, where it is the BLAS in use: it keeps to one thread, as the many small products of a factorisation leave
// threads waiting for each other and results would depend on their number; and it gets its work space while there is
// memory, as it would wait for it for ever.
void prepare_blas() {
  choose_blas_kernels();
  if (const auto set_threads = function_of_blas<void (*)(int)>("openblas_set_num_threads")) set_threads(1);
  constexpr std::size_t kWorkSpace = 160'000'000;
  if (std::unique_ptr<char[]>(new (std::nothrow) char[kWorkSpace]) == nullptr) throw WorkError("not enough memory");
  const PetscBLASInt one = 1;
  PetscScalar value = 1;
  BLASgemm_("N", "N", &one, &one, &one, &value, &value, &one, &value, &one, &value, &value, &one);
}

// Factors go back to the system when they are freed; Open MPI would have them kept, in pieces that the next ones do not
// fit in.
void return_freed_memory() {
  constexpr int kOwnPages = 32 << 20;  // glibc's largest
  mallopt(M_MMAP_MAX, 1 << 16);
  mallopt(M_MMAP_THRESHOLD, kOwnPages);
  mallopt(M_TRIM_THRESHOLD, 2 * kOwnPages);
}

/// A name of PETSc's database as it stands on a command line.
std::string word_of(std::string name) {
  std::replace(name.begin(), name.end(), '_', '-');
  return "--" + name;
}

}  // namespace

// PETSc and MPI cannot be started a second time, so they end with the program.
void start_solvers() {
  static const bool started = [] {
    set_environment();
    prepare_blas();
    static_cast<void>(current_folder());  // PETSc asks for its path, and ends the program where there is none
    for (const char* name : {"PETSC_OPTIONS", "PETSC_OPTIONS_YAML"}) unsetenv(name);
    // A file .petscrc beside the user could load a library. Signals are the program's matter (common/console).
    std::array<char*, 4> words{const_cast<char*>("exmat"), const_cast<char*>("-skip_petscrc"),
                               const_cast<char*>("-no_signal_handler"), nullptr};
    int count = static_cast<int>(words.size()) - 1;
    char** arguments = words.data();
    check_petsc(SlepcInitialize(&count, &arguments, nullptr, nullptr), "initialisation");
    return_freed_memory();
    check_petsc(PetscPushErrorHandler(remember_error, nullptr), "error handler");
    std::atexit([] { SlepcFinalize(); });
    return true;
  }();
  static_cast<void>(started);
}

std::string& last_petsc_message() {
  static std::string message;
  return message;
}

MPI_Comm team() { return ranks().team; }
int team_rank() { return ranks().rank; }
int rank_count() { return ranks().size; }

void announce(const Call& call) {
  if (rank_count() == 1) return;
  Call sent = call;
  MPI_Request request = MPI_REQUEST_NULL;  // as the others wait for it
  MPI_Ibcast(&sent, sizeof sent, MPI_BYTE, 0, team(), &request);
  MPI_Wait(&request, MPI_STATUS_IGNORE);
}

int run_on_ranks(const std::function<int()>& program) {
  if (!started_by_mpirun()) return program();
  start_solvers();
  MPI_Comm_size(PETSC_COMM_WORLD, &ranks().size);
  MPI_Comm_rank(PETSC_COMM_WORLD, &ranks().rank);
  ranks().team = PETSC_COMM_WORLD;
  if (!leads()) return serve();
  const int status = program();
  announce({Task::kStop, 0, {status}});
  return status;
}

std::int64_t peak_memory_of_ranks() {
  announce({Task::kPeakMemory});
  return largest_peak_memory();
}

void configure_solvers(const SolverSettings& wanted) {
  if (wanted == settings() && wanted.options.empty()) return;
  start_solvers();
  const Call call{Task::kConfigure,
                  0,
                  {static_cast<std::int64_t>(wanted.eigensolver), static_cast<std::int64_t>(wanted.options.size())}};
  announce(call);
  share_settings(call, wanted);
}

const SolverSettings& solver_settings() { return settings(); }

std::string words_of_options() {
  std::string words;
  for (const auto& [name, value] : settings().options)
    words += (words.empty() ? "" : " ") + word_of(name) + (value.empty() ? "" : " " + value);
  return words;
}

void require_options_taken() {
  for (const auto& [name, value] : settings().options) {
    PetscBool taken = PETSC_FALSE;
    check_petsc(PetscOptionsUsed(nullptr, name.c_str(), &taken), "options");
    if (taken == PETSC_TRUE) continue;
    throw InputError({"command line", word_of(name), "an option of the solvers in use", "one that none of them takes",
                      "mend its name, or leave it out; --st-ksp-... and --st-pc-... go with --eigensolver gamg or "
                      "lobpcg alone"});
  }
}

}  // namespace exmat::precompute
