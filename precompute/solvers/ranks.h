#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <utility>
#include <vector>

namespace exmat::precompute {

/// Runs `program` on the first of the ranks that mpirun started and returns its exit status on all of them. The others
/// hold and compute their shares of what it factorises and solves, and sleep between. What fails on any rank is thrown
/// as WorkError in `program`; where a rank cannot wait for the others to hear of it, all of them end with status 1.
/// Without mpirun: `program()`. Call it once, in main.
int run_on_ranks(const std::function<int()>& program);

/// Ranks that solve together; 1 without mpirun.
int rank_count();

/// Most memory that any rank has had so far.
std::int64_t peak_memory_of_ranks();

enum class Eigensolver {
  kAuto,    ///< kDirect for small meshes, kMixed for large ones, kLobpcg where factors do not fit into the memory
  kDirect,  ///< MUMPS and Krylov-Schur on the inverse
  kMixed,   ///< factors in single precision with conjugate gradients, and block Davidson; kDirect where they do not
            ///< serve
  kGamg,    ///< conjugate gradients with algebraic multigrid in place of MUMPS
  kLobpcg,  ///< as kGamg, and LOBPCG with multigrid for eigenpairs
};

struct SolverSettings {
  Eigensolver eigensolver = Eigensolver::kAuto;
  /// Names and values for PETSc's options database, "eps_ncv" and "60"; the value may be empty.
  std::vector<std::pair<std::string, std::string>> options{};
  // Limits for kAuto.
  std::int64_t large = 60'000;  ///< rows from which on factors in single precision are worth their iterations
  std::int64_t memory = 0;      ///< bytes that factors may take; 0: what the system has to give

  bool operator==(const SolverSettings&) const = default;
};

/// Sets how all ranks solve from now on. Options that start with "eps_" go to SLEPc's eigensolver, those with "st_ksp_"
/// and "st_pc_" to the linear solver of kGamg and kLobpcg; the first eigenpairs throw InputError where no solver took
/// one. With options kAuto is kDirect.
void configure_solvers(const SolverSettings& settings);

}  // namespace exmat::precompute
