#pragma once

// Private to precompute/solvers: how ranks work together. The leader, rank 0, announces each collective piece of work;
// the others wait for it in run_on_ranks and call the same function with nothing in place of what the leader has.

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <functional>

#include "precompute/solvers/petsc_handles.h"
#include "precompute/solvers/ranks.h"

namespace exmat::precompute {

enum class Task : std::int64_t {
  kStop,
  kForget,
  kPeakMemory,
  kConfigure,
  kFactorise,
  kSolve,
  kPoseEigenproblem,
  kSearch
};

struct Call {
  Task task = Task::kStop;
  std::int64_t object = 0;  ///< id of a Share
  std::array<std::int64_t, 4> numbers{};
};

/// A rank's part of an object of the leader's.
struct Share {
  virtual ~Share() = default;
  std::int64_t id = 0;
};

/// All ranks, once the solvers have started; else this one.
MPI_Comm team();
int team_rank();
inline bool leads() { return team_rank() == 0; }

/// On the leader; wakes the others up.
void announce(const Call& call);
/// A new id for a share, on the leader.
std::int64_t new_share_id();
/// To be called first in the destructors of shares: their members are destroyed together. Does nothing but on the
/// leader.
void forget(std::int64_t id);

/// Does this rank's share of a collective piece of work, then throws WorkError on all ranks where one has thrown. A
/// rank that waits in vain for the others, which are stuck in the work, says what it has thrown and ends them all.
void agree(const std::function<void()>& work);

const SolverSettings& solver_settings();
/// The options that were given, as on a command line.
std::string words_of_options();
/// Throws InputError where an option was given that no solver has taken.
void require_options_taken();

/// Which rows each rank has: contiguous, multiples of `block`, the border's rows on the last.
struct Layout {
  Eigen::Index size = 0, block = 1;

  Eigen::Index begin(int rank) const { return size / block * rank / rank_count() * block; }
  Eigen::Index rows(int rank) const { return begin(rank + 1) - begin(rank); }
  Eigen::Index own_rows() const { return rows(team_rank()); }
};
inline bool is_last() { return team_rank() == rank_count() - 1; }

/// [own rows x columns] of the leader's [n x columns]; collective.
Eigen::MatrixXd scatter_rows(const Layout& layout, const Eigen::MatrixXd& whole, Eigen::Index columns);
/// On the leader [n x columns] of all ranks' rows; collective.
Eigen::MatrixXd gather_rows(const Layout& layout, const Eigen::MatrixXd& own);
/// Sums over ranks.
void add_up(Eigen::MatrixXd& values);

/// Copies the leader's matrix of Eigen's to all ranks' shares of one of PETSc's; the leader's `border` [n x c] is
/// appended as c more columns and, transposed, as c more rows. Collective; the others give nothing but `layout` and c.
MatHandle to_petsc(const Layout& layout, const SparseMatrix& matrix, const Eigen::MatrixXd& border, Eigen::Index c);

}  // namespace exmat::precompute
