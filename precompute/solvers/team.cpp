#include "precompute/solvers/team.h"

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <new>
#include <string>
#include <thread>
#include <vector>

namespace exmat::precompute {
namespace {

using Clock = std::chrono::steady_clock;

// Time that a rank that failed waits for the others before it ends them all.
constexpr std::chrono::seconds kTeamPatience{10};
constexpr std::chrono::milliseconds kTeamNap{1};
constexpr int kLeader = 0, kRowsTag = 1, kMatrixTag = 2;

std::int64_t& last_share_id() {
  static std::int64_t id = 0;
  return id;
}

// Ends all ranks: the others will not come.
[[noreturn]] void end_all(const std::string& failure) {
  std::fputs(("exmat-precompute: " + failure + "\n").c_str(), stderr);
  std::fflush(stderr);
  MPI_Abort(team(), static_cast<int>(ExitStatus::kFailure));
  std::abort();
}

// The first rank that has failed, or the number of ranks.
int first_failed(const std::string& failure) {
  const int mine = failure.empty() ? rank_count() : team_rank();
  int first = 0;
  MPI_Request request = MPI_REQUEST_NULL;
  MPI_Iallreduce(&mine, &first, 1, MPI_INT, MPI_MIN, team(), &request);
  if (failure.empty()) {
    MPI_Wait(&request, MPI_STATUS_IGNORE);
    return first;
  }
  const auto deadline = Clock::now() + kTeamPatience;
  for (int done = 0; done == 0; std::this_thread::sleep_for(kTeamNap)) {
    MPI_Test(&request, &done, MPI_STATUS_IGNORE);
    if (done == 0 && Clock::now() > deadline) end_all(failure);
  }
  return first;
}

std::string told_by(int rank, std::string text) {
  auto size = static_cast<int>(text.size());
  MPI_Bcast(&size, 1, MPI_INT, rank, team());
  text.resize(static_cast<std::size_t>(size));
  MPI_Bcast(text.data(), size, MPI_CHAR, rank, team());
  return text;
}

// Compressed rows of one rank.
struct Rows {
  std::vector<PetscInt> starts{0}, columns;
  std::vector<PetscScalar> values;

  void add(Eigen::Index column, double value) {
    columns.push_back(static_cast<PetscInt>(column));
    values.push_back(value);
  }
  void end_row() { starts.push_back(static_cast<PetscInt>(columns.size())); }
};

Rows rows_of(int rank, const Layout& layout, const SparseMatrix& matrix, const Eigen::MatrixXd& border) {
  Rows rows;
  const Eigen::Index n = layout.size, c = border.cols(), begin = layout.begin(rank), end = layout.begin(rank + 1);
  const bool last = rank == rank_count() - 1;
  const auto entries = static_cast<std::size_t>(matrix.outerIndexPtr()[end] - matrix.outerIndexPtr()[begin] +
                                                (end - begin) * c + (last ? c * (n + 1) : 0));
  rows.columns.reserve(entries);
  rows.values.reserve(entries);
  for (Eigen::Index i = begin; i < end; ++i) {
    for (SparseMatrix::InnerIterator entry(matrix, i); entry; ++entry) rows.add(entry.col(), entry.value());
    for (Eigen::Index k = 0; k < c; ++k) rows.add(n + k, border(i, k));
    rows.end_row();
  }
  for (Eigen::Index k = 0; last && k < c; ++k) {
    for (Eigen::Index i = 0; i < n; ++i) rows.add(i, border(i, k));
    rows.add(n + k, 0);  // the zero diagonal of the border is stored: PETSc's factorisations ask for it
    rows.end_row();
  }
  return rows;
}

template <typename Value>
void send(const std::vector<Value>& values, MPI_Datatype type, int rank) {
  MPI_Send(values.data(), static_cast<int>(values.size()), type, rank, kMatrixTag, team());
}

template <typename Value>
void receive(std::vector<Value>& values, MPI_Datatype type) {
  MPI_Status status;
  int count = 0;
  MPI_Probe(kLeader, kMatrixTag, team(), &status);
  MPI_Get_count(&status, type, &count);
  values.resize(static_cast<std::size_t>(count));
  MPI_Recv(values.data(), count, type, kLeader, kMatrixTag, team(), MPI_STATUS_IGNORE);
}

Rows own_rows_of(const Layout& layout, const SparseMatrix& matrix, const Eigen::MatrixXd& border) {
  Rows rows;
  if (!leads()) {
    receive(rows.starts, MPIU_INT);
    receive(rows.columns, MPIU_INT);
    receive(rows.values, MPIU_SCALAR);
    return rows;
  }
  for (int rank = 1; rank < rank_count(); ++rank) {
    rows = rows_of(rank, layout, matrix, border);
    send(rows.starts, MPIU_INT, rank);
    send(rows.columns, MPIU_INT, rank);
    send(rows.values, MPIU_SCALAR, rank);
  }
  return rows_of(kLeader, layout, matrix, border);
}

}  // namespace

std::int64_t new_share_id() { return ++last_share_id(); }

void forget(std::int64_t id) {
  if (leads() && id != 0) announce({Task::kForget, id});
}

void agree(const std::function<void()>& work) {
  if (rank_count() == 1) return work();
  std::string failure;
  try {
    work();
  } catch (const std::bad_alloc&) {
    failure = "not enough memory";
  } catch (const std::exception& error) {
    failure = error.what();
  }
  const int first = first_failed(failure);
  if (first < rank_count()) throw WorkError(told_by(first, failure));
}

Eigen::MatrixXd scatter_rows(const Layout& layout, const Eigen::MatrixXd& whole, Eigen::Index columns) {
  if (rank_count() == 1) return whole;
  Eigen::MatrixXd own(layout.own_rows(), columns);
  for (Eigen::Index k = 0; k < columns; ++k) {
    if (!leads()) {
      MPI_Recv(own.col(k).data(), static_cast<int>(own.rows()), MPI_DOUBLE, kLeader, kRowsTag, team(),
               MPI_STATUS_IGNORE);
      continue;
    }
    own.col(k) = whole.col(k).head(own.rows());
    for (int rank = 1; rank < rank_count(); ++rank)
      MPI_Send(whole.col(k).data() + layout.begin(rank), static_cast<int>(layout.rows(rank)), MPI_DOUBLE, rank,
               kRowsTag, team());
  }
  return own;
}

Eigen::MatrixXd gather_rows(const Layout& layout, const Eigen::MatrixXd& own) {
  if (rank_count() == 1) return own;
  Eigen::MatrixXd whole(leads() ? layout.size : 0, own.cols());
  for (Eigen::Index k = 0; k < own.cols(); ++k) {
    if (!leads()) {
      MPI_Send(own.col(k).data(), static_cast<int>(own.rows()), MPI_DOUBLE, kLeader, kRowsTag, team());
      continue;
    }
    whole.col(k).head(own.rows()) = own.col(k);
    for (int rank = 1; rank < rank_count(); ++rank)
      MPI_Recv(whole.col(k).data() + layout.begin(rank), static_cast<int>(layout.rows(rank)), MPI_DOUBLE, rank,
               kRowsTag, team(), MPI_STATUS_IGNORE);
  }
  return whole;
}

void add_up(Eigen::MatrixXd& values) {
  if (rank_count() > 1)
    MPI_Allreduce(MPI_IN_PLACE, values.data(), static_cast<int>(values.size()), MPI_DOUBLE, MPI_SUM, team());
}

MatHandle to_petsc(const Layout& layout, const SparseMatrix& matrix, const Eigen::MatrixXd& border, Eigen::Index c) {
  const Rows rows = own_rows_of(layout, matrix, border);
  const auto own = static_cast<PetscInt>(layout.own_rows() + (is_last() ? c : 0));
  const auto all = static_cast<PetscInt>(layout.size + c);
  MatHandle result;
  check_petsc(MatCreate(team(), result.out()), "matrix");
  check_petsc(MatSetSizes(result.get(), own, own, all, all), "matrix");
  if (c == 0) check_petsc(MatSetBlockSize(result.get(), static_cast<PetscInt>(layout.block)), "matrix");
  check_petsc(MatSetType(result.get(), MATAIJ), "matrix");
  const auto *starts = rows.starts.data(), *columns = rows.columns.data();
  // One of these does nothing: it is for the other type.
  check_petsc(MatSeqAIJSetPreallocationCSR(result.get(), starts, columns, rows.values.data()), "matrix rows");
  check_petsc(MatMPIAIJSetPreallocationCSR(result.get(), starts, columns, rows.values.data()), "matrix rows");
  check_petsc(MatSetOption(result.get(), MAT_SYMMETRIC, PETSC_TRUE), "matrix symmetry");
  return result;
}

}  // namespace exmat::precompute
