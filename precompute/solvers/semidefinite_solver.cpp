#include "precompute/solvers/semidefinite_solver.h"

#include <cstdlib>
#include <slepcsys.h>
#include <vector>

#include "precompute/solvers/petsc_handles.h"
#include "precompute/solvers/solver_access.h"

namespace exmat::precompute {
namespace {

// Keeps the text of the first error for check_petsc, which throws it once the call has returned.
PetscErrorCode remember_error(MPI_Comm, int, const char*, const char*, PetscErrorCode code, PetscErrorType type,
                              const char* message, void*) {
  if (type == PETSC_ERROR_INITIAL) last_petsc_message() = message;
  return code;
}

}  // namespace

// PETSc and MPI cannot be started a second time, so they end with the program.
void start_solvers() {
  static const bool started = [] {
    // A single process needs no daemon, no binding and no network. mpirun sets its own.
    setenv("OMPI_MCA_ess_singleton_isolated", "1", 0);
    setenv("HWLOC_HIDE_ERRORS", "2", 0);  // stderr is for the log, also in containers without /sys
    setenv("OMPI_MCA_hwloc_base_binding_policy", "none", 0);
    setenv("OMPI_MCA_btl", "self,vader", 0);
    check_petsc(SlepcInitializeNoArguments(), "initialisation");
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

std::string solver_versions() {
  const auto text = [](int major, int minor, int sub) {
    return std::to_string(major) + "." + std::to_string(minor) + "." + std::to_string(sub);
  };
  return "PETSc " + text(PETSC_VERSION_MAJOR, PETSC_VERSION_MINOR, PETSC_VERSION_SUBMINOR) + ", SLEPc " +
         text(SLEPC_VERSION_MAJOR, SLEPC_VERSION_MINOR, SLEPC_VERSION_SUBMINOR);
}

MatHandle to_petsc(const SparseMatrix& matrix, const Eigen::MatrixXd& border) {
  const auto n = static_cast<PetscInt>(matrix.rows());
  const auto c = static_cast<PetscInt>(border.cols());
  std::vector<PetscInt> row_sizes(static_cast<std::size_t>(n + c));
  for (PetscInt i = 0; i < n; ++i)
    row_sizes[static_cast<std::size_t>(i)] = matrix.outerIndexPtr()[i + 1] - matrix.outerIndexPtr()[i] + c;
  // The zero diagonal of the border is stored: PETSc's factorisations ask for it.
  for (PetscInt k = 0; k < c; ++k) row_sizes[static_cast<std::size_t>(n + k)] = n + 1;

  MatHandle result;
  check_petsc(MatCreateSeqAIJ(PETSC_COMM_SELF, n + c, n + c, 0, row_sizes.data(), result.out()), "matrix");
  std::vector<PetscInt> columns;
  std::vector<PetscScalar> values;
  const auto set_row = [&](PetscInt row) {
    check_petsc(MatSetValues(result.get(), 1, &row, static_cast<PetscInt>(columns.size()), columns.data(),
                             values.data(), INSERT_VALUES),
                "matrix row");
    columns.clear();
    values.clear();
  };
  for (PetscInt i = 0; i < n; ++i) {
    for (SparseMatrix::InnerIterator entry(matrix, i); entry; ++entry) {
      columns.push_back(static_cast<PetscInt>(entry.col()));
      values.push_back(entry.value());
    }
    for (PetscInt k = 0; k < c; ++k) {
      columns.push_back(n + k);
      values.push_back(border(i, k));
    }
    set_row(i);
  }
  for (PetscInt k = 0; k < c; ++k) {
    for (PetscInt i = 0; i < n; ++i) {
      columns.push_back(i);
      values.push_back(border(i, k));
    }
    columns.push_back(n + k);
    values.push_back(0);
    set_row(n + k);
  }
  check_petsc(MatAssemblyBegin(result.get(), MAT_FINAL_ASSEMBLY), "matrix assembly");
  check_petsc(MatAssemblyEnd(result.get(), MAT_FINAL_ASSEMBLY), "matrix assembly");
  check_petsc(MatSetOption(result.get(), MAT_SYMMETRIC, PETSC_TRUE), "matrix symmetry");
  return result;
}

SemidefiniteSolver::SemidefiniteSolver(const SparseMatrix& matrix, const Eigen::MatrixXd& mass_times_null_space,
                                       const std::string& name)
    : implementation_(std::make_unique<Implementation>()) {
  start_solvers();
  auto& self = *implementation_;
  self.size = matrix.rows();
  self.border = mass_times_null_space.cols();
  // Both blocks of the bordered matrix get one scale, whatever the units.
  const double scale = matrix.diagonal().cwiseAbs().mean();
  const double border_norm = self.border > 0 ? mass_times_null_space.cwiseAbs().maxCoeff() : 1.0;
  self.matrix = to_petsc(matrix, mass_times_null_space * (scale / border_norm));

  Mat& factor = *self.factor.out();
  check_petsc(MatGetFactor(self.matrix.get(), MATSOLVERMUMPS, MAT_FACTOR_CHOLESKY, &factor), "choice of MUMPS");
  check_petsc(MatMumpsSetIcntl(factor, 13, 1), "MUMPS option");  // inertia needs the root factored in one piece
  check_petsc(MatMumpsSetIcntl(factor, 24, 1), "MUMPS option");  // detect null pivots
  MatFactorInfo info;
  check_petsc(MatFactorInfoInitialize(&info), "factor options");
  check_petsc(MatCholeskyFactorSymbolic(factor, self.matrix.get(), nullptr, &info), "symbolic factorisation");
  check_petsc(MatCholeskyFactorNumeric(factor, self.matrix.get(), &info), "factorisation");

  PetscInt negative = 0, zero = 0, positive = 0;
  check_petsc(MatGetInertia(factor, &negative, &zero, &positive), "inertia");
  if (negative != self.border || zero != 0)
    throw WorkError(
        name + ": expected " + std::to_string(self.border) + " negative and no zero pivots, found " +
        std::to_string(negative) + " and " + std::to_string(zero) +
        ": parts of the body can move without deforming it (hinges, or tets joined only in an edge or a vertex)");
}

SemidefiniteSolver::~SemidefiniteSolver() = default;
SemidefiniteSolver::SemidefiniteSolver(SemidefiniteSolver&&) noexcept = default;

Eigen::Index SemidefiniteSolver::size() const { return implementation_->size; }

Eigen::MatrixXd SemidefiniteSolver::solve(const Eigen::MatrixXd& right_hand_sides) const {
  const auto& self = *implementation_;
  if (right_hand_sides.cols() == 0) return right_hand_sides;
  const Eigen::Index full = self.size + self.border;
  Eigen::MatrixXd extended = Eigen::MatrixXd::Zero(full, right_hand_sides.cols());
  extended.topRows(self.size) = right_hand_sides;
  Eigen::MatrixXd solution(full, right_hand_sides.cols());
  const auto rows = static_cast<PetscInt>(full), columns = static_cast<PetscInt>(right_hand_sides.cols());
  MatHandle b, x;
  check_petsc(MatCreateSeqDense(PETSC_COMM_SELF, rows, columns, extended.data(), b.out()), "right-hand sides");
  check_petsc(MatCreateSeqDense(PETSC_COMM_SELF, rows, columns, solution.data(), x.out()), "solutions");
  check_petsc(MatMatSolve(self.factor.get(), b.get(), x.get()), "solve");
  return solution.topRows(self.size);
}

}  // namespace exmat::precompute
