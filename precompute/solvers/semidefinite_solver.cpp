#include "precompute/solvers/semidefinite_solver.h"

#include <algorithm>
#include <array>
#include <cstdio>
#include <omp.h>
#include <slepcsys.h>
#include <utility>
#include <vector>

#include "common/core/decompositions.h"
#include "common/core/log.h"
#include "precompute/solvers/available_memory.h"
#include "precompute/solvers/blas.h"
#include "precompute/solvers/solver_access.h"
#include "precompute/solvers/tall.h"

namespace exmat::precompute {
namespace {

// Accuracy of conjugate gradients: |b - K x| / |b|.
constexpr double kIterationTolerance = 1e-12;
// Share of the right-hand side as given: what is left of one along the null space is rounding.
constexpr double kRounding = 1e-14;
constexpr PetscInt kMostKrylovIterations = 2000;
// Share of the mean of the diagonal that the matrix which multigrid is made for is shifted by, where K has null
// vectors.
constexpr double kShift = 1e-6;
constexpr Eigen::Index kRigidMotions = 6;
// Work space beyond what the pattern of the matrix needs [%], tried one after the other; the first is MUMPS's own.
constexpr std::array<PetscInt, 7> kWorkSpaces{20, 60, 140, 300, 700, 1500, 3100};
// Right-hand sides that are copied and solved for together: more are no faster with MUMPS. Factors in single precision
// are copied into the order of BLAS's kernels for each pass, so that more columns cost little.
constexpr Eigen::Index kSolvedTogether = 32, kSolvedTogetherMixed = 64;

// Vertices stay whole in multigrid where the matrix is that of displacements.
Eigen::Index block_of(Eigen::Index soft) { return soft == kRigidMotions ? 3 : 1; }

// columns -= along onto^T columns, of all ranks' rows.
void remove(const Eigen::MatrixXd& along, const Eigen::MatrixXd& onto, Eigen::MatrixXd& columns) {
  if (along.cols() == 0) return;
  Eigen::MatrixXd products = onto.transpose() * columns;
  add_up(products);
  columns -= along * products;
}

// Norms over all ranks' rows.
Eigen::VectorXd norms(const Eigen::MatrixXd& columns) {
  Eigen::MatrixXd squares = columns.colwise().squaredNorm();
  add_up(squares);
  return squares.cwiseSqrt().transpose();
}

Eigen::MatrixXd orthonormal(const Eigen::MatrixXd& fields) {
  if (fields.size() == 0) return fields;
  const Eigen::HouseholderQR<Eigen::MatrixXd> factors(fields);
  return factors.householderQ() * Eigen::MatrixXd::Identity(fields.rows(), fields.cols());
}

// A vector on the ranks' own values, which must outlive it.
VecHandle view(const Eigen::Ref<const Eigen::VectorXd>& own) {
  VecHandle vector;
  check_petsc(
      VecCreateMPIWithArray(team(), 1, static_cast<PetscInt>(own.size()), PETSC_DETERMINE, own.data(), vector.out()),
      "vector");
  return vector;
}

NullSpaceHandle null_space_of(const Eigen::MatrixXd& own, Eigen::Index block) {
  std::vector<VecHandle> handles;
  std::vector<Vec> raw;
  for (Eigen::Index k = 0; k < own.cols(); ++k) {
    VecHandle copy;
    const VecHandle original = view(own.col(k));
    check_petsc(VecDuplicate(original.get(), copy.out()), "vector");
    check_petsc(VecCopy(original.get(), copy.get()), "vector");
    check_petsc(VecSetBlockSize(copy.get(), static_cast<PetscInt>(block)), "vector");
    raw.push_back(handles.emplace_back(std::move(copy)).get());
  }
  NullSpaceHandle space;
  check_petsc(MatNullSpaceCreate(team(), PETSC_FALSE, static_cast<PetscInt>(raw.size()), raw.data(), space.out()),
              "null space");
  return space;
}

std::string gigabytes(std::int64_t bytes) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%.2f GB", 1e-9 * static_cast<double>(bytes));
  return text.data();
}

[[noreturn]] void refuse_for_memory(const char* what) {
  throw WorkError(std::string("not enough memory for the ") + what + "; use more ranks, or --eigensolver gamg");
}

// INFOG(1) of MUMPS: 0 or more where it has done its work.
PetscInt state_of(Mat factor) {
  PetscInt state = 0;
  check_petsc(MatMumpsGetInfog(factor, 1, &state), "state of MUMPS");
  return state;
}

// The system had no more memory to give.
bool lacks_memory(PetscInt state) { return state == -5 || state == -7 || state == -13; }

// More entries than the analysis had foreseen: pivots that were put off.
bool lacks_work_space(PetscInt state) { return state == -8 || state == -9 || state == -17 || state == -20; }

// MUMPS's failures are no errors to PETSc.
void require_factors(Mat factor) {
  MatFactorError error = MAT_FACTOR_NOERROR;
  check_petsc(MatFactorGetError(factor, &error), "state of the factorisation");
  if (error == MAT_FACTOR_NOERROR) return;
  const PetscInt state = state_of(factor);
  if (lacks_memory(state)) refuse_for_memory("factors");
  if (lacks_work_space(state))
    throw IllConditioned("MUMPS cannot factorise the matrix in " + std::to_string(1 + kWorkSpaces.back() / 100) +
                         " times the work space that its pattern needs");
  throw WorkError("MUMPS cannot factorise the matrix: INFOG(1) = " + std::to_string(state));
}

// L D L^T with `more` work space [%].
void factorise_within(PetscInt more, Mat matrix, MatHandle& factor) {
  factor = {};
  Mat& made = *factor.out();
  check_petsc(MatGetFactor(matrix, MATSOLVERMUMPS, MAT_FACTOR_CHOLESKY, &made), "choice of MUMPS");
  check_petsc(MatMumpsSetIcntl(made, 13, 1), "MUMPS option");  // inertia needs the root factored in one piece
  check_petsc(MatMumpsSetIcntl(made, 24, 1), "MUMPS option");  // detect null pivots
  check_petsc(MatMumpsSetIcntl(made, 14, more), "MUMPS option");
  MatFactorInfo info;
  check_petsc(MatFactorInfoInitialize(&info), "factor options");
  check_petsc(MatCholeskyFactorSymbolic(made, matrix, nullptr, &info), "symbolic factorisation");
  check_petsc(MatCholeskyFactorNumeric(made, matrix, &info), "factorisation");
}

void require_solved(PetscErrorCode code, Mat factor) {
  if (code != 0 && lacks_memory(state_of(factor))) refuse_for_memory("solutions");
  check_petsc(code, "solve");
}

struct Choice {
  Means means = Means::kMumps;
  std::unique_ptr<MixedSolver> mixed{};
};

// Factors in single precision, where they serve. Several ranks have MUMPS, which shares its work among them.
Choice choose(const SparseMatrix& matrix, const Eigen::MatrixXd& mass_times_null_space,
              const Eigen::MatrixXd& soft_fields, const std::string& name) {
  const SolverSettings& settings = solver_settings();
  const bool by_itself = settings.eigensolver == Eigensolver::kAuto, bordered = mass_times_null_space.cols() > 0;
  if (settings.eigensolver == Eigensolver::kGamg || settings.eigensolver == Eigensolver::kLobpcg)
    return {Means::kMultigrid};
  const bool large = by_itself && settings.options.empty() && matrix.rows() >= settings.large;
  const bool knows_null_space = !bordered || soft_fields.cols() > 0;
  if ((settings.eigensolver != Eigensolver::kMixed && !large) || rank_count() > 1 || !knows_null_space) return {};
  const int block = static_cast<int>(block_of(soft_fields.cols()));
  const std::shared_ptr<const Elimination> plan = dissected_elimination(graph_of(matrix, block), block);
  const std::int64_t needed = SingleCholesky::bytes(*plan, block, omp_get_max_threads()),
                     there = settings.memory > 0 ? settings.memory : available_memory();
  if (by_itself && needed > there) {
    log::info(name + ": its factors would take " + gigabytes(needed) + " of memory, and there is " + gigabytes(there) +
              "; multigrid and LOBPCG in their place");
    return {Means::kMultigrid};
  }
  auto mixed = std::make_unique<MixedSolver>(matrix, bordered ? soft_fields : mass_times_null_space,
                                             mass_times_null_space, block, plan);
  if (mixed->objection().empty()) {
    log::info(name + ": factors in single precision, " + gigabytes(needed) +
              (blas_callers() < omp_get_max_threads() ? ", by one thread: OpenBLAS was built without" : ""));
    return {Means::kMixed, std::move(mixed)};
  }
  log::info(name + ": " + mixed->objection() + "; factors in double in their place");
  return {};
}

}  // namespace

std::string solver_versions() {
  const auto text = [](int major, int minor, int sub) {
    return std::to_string(major) + "." + std::to_string(minor) + "." + std::to_string(sub);
  };
  return "PETSc " + text(PETSC_VERSION_MAJOR, PETSC_VERSION_MINOR, PETSC_VERSION_SUBMINOR) + ", SLEPc " +
         text(SLEPC_VERSION_MAJOR, SLEPC_VERSION_MINOR, SLEPC_VERSION_SUBMINOR);
}

SolverShare::SolverShare(const Call& call)
    : layout{call.numbers[0], 1},
      border(call.numbers[1]),
      soft(call.numbers[2]),
      means(static_cast<Means>(call.numbers[3])) {
  id = call.object;
  if (means == Means::kMultigrid) layout.block = block_of(soft);
}

SolverShare::~SolverShare() { forget(id); }

void SolverShare::factorise(const SparseMatrix& whole, const Eigen::MatrixXd& mass_times_null_space,
                            const Eigen::MatrixXd& soft_fields) {
  agree([&] {
    if (means == Means::kMumps) return factorise_directly(whole, mass_times_null_space);
    set_up_multigrid(whole, mass_times_null_space, soft_fields);
  });
}

void SolverShare::factorise_directly(const SparseMatrix& whole, const Eigen::MatrixXd& mass_times_null_space) {
  // Both blocks of the bordered matrix get one scale, whatever the units.
  const double scale = leads() ? whole.diagonal().cwiseAbs().mean() : 0;
  const double border_norm = leads() && border > 0 ? mass_times_null_space.cwiseAbs().maxCoeff() : 1.0;
  matrix = to_petsc(layout, whole, mass_times_null_space * (scale / border_norm), border);

  for (const PetscInt more : kWorkSpaces) {
    factorise_within(more, matrix.get(), factor);
    if (!lacks_work_space(state_of(factor.get()))) break;
  }
  require_factors(factor.get());
  matrix = {};
}

void SolverShare::set_up_multigrid(const SparseMatrix& whole, const Eigen::MatrixXd& mass_times_null_space,
                                   const Eigen::MatrixXd& soft_fields) {
  matrix = to_petsc(layout, whole, {}, 0);
  mass_null_space = scatter_rows(layout, mass_times_null_space, border);
  if (border > 0) null_space = scatter_rows(layout, soft_fields, border);
  if (soft > 0) {
    soft_space = null_space_of(scatter_rows(layout, orthonormal(soft_fields), soft), layout.block);
    check_petsc(MatSetNearNullSpace(matrix.get(), soft_space.get()), "soft fields");
  }
  Mat made_for = matrix.get();
  if (border > 0) {
    check_petsc(MatSetNullSpace(matrix.get(), soft_space.get()), "null space");
    double shift = leads() ? kShift * whole.diagonal().mean() : 0;
    MPI_Bcast(&shift, 1, MPI_DOUBLE, 0, team());
    check_petsc(MatDuplicate(matrix.get(), MAT_COPY_VALUES, shifted.out()), "matrix");
    check_petsc(MatSetNearNullSpace(shifted.get(), soft_space.get()), "soft fields");
    check_petsc(MatShift(shifted.get(), shift), "shift");
    made_for = shifted.get();
  }
  PC multigrid = nullptr;
  check_petsc(KSPCreate(team(), iteration.out()), "linear solver");
  check_petsc(KSPSetOperators(iteration.get(), matrix.get(), made_for), "linear solver");
  check_petsc(KSPSetType(iteration.get(), KSPCG), "linear solver");
  check_petsc(KSPSetNormType(iteration.get(), KSP_NORM_UNPRECONDITIONED), "linear solver");
  check_petsc(
      KSPSetTolerances(iteration.get(), kIterationTolerance, PETSC_DEFAULT, PETSC_DEFAULT, kMostKrylovIterations),
      "linear solver");
  check_petsc(KSPGetPC(iteration.get(), &multigrid), "multigrid");
  check_petsc(PCSetType(multigrid, PCGAMG), "multigrid");
  check_petsc(KSPSetOptionsPrefix(iteration.get(), "st_"), "linear solver");
  check_petsc(KSPSetFromOptions(iteration.get()), "options of the linear solver");
  check_petsc(KSPSetUp(iteration.get()), "multigrid");
}

Eigen::MatrixXd SolverShare::solve(const Eigen::MatrixXd& right_hand_sides, Eigen::Index columns) const {
  Eigen::MatrixXd solutions;
  agree([&] { solutions = gather_rows(layout, solve_rows(scatter_rows(layout, right_hand_sides, columns))); });
  return solutions;
}

Eigen::MatrixXd SolverShare::solve_rows(const Eigen::MatrixXd& right_hand_sides) const {
  if (means == Means::kMixed) return mixed->solve(by_rows(right_hand_sides));
  return means == Means::kMumps ? solve_directly(right_hand_sides) : iterate(right_hand_sides);
}

Eigen::MatrixXd SolverShare::solve_directly(const Eigen::MatrixXd& right_hand_sides) const {
  const Eigen::Index own = right_hand_sides.rows(), extended_rows = own + (is_last() ? border : 0);
  Eigen::MatrixXd extended = Eigen::MatrixXd::Zero(extended_rows, right_hand_sides.cols());
  extended.topRows(own) = right_hand_sides;
  Eigen::MatrixXd solution(extended_rows, right_hand_sides.cols());
  const auto rows = static_cast<PetscInt>(extended_rows), columns = static_cast<PetscInt>(right_hand_sides.cols()),
             all = static_cast<PetscInt>(layout.size + border);
  MatHandle b, x;
  check_petsc(MatCreateDense(team(), rows, PETSC_DECIDE, all, columns, extended.data(), b.out()), "right-hand sides");
  check_petsc(MatCreateDense(team(), rows, PETSC_DECIDE, all, columns, solution.data(), x.out()), "solutions");
  require_solved(MatMatSolve(factor.get(), b.get(), x.get()), factor.get());
  return solution.topRows(own);
}

Eigen::MatrixXd SolverShare::iterate(Eigen::MatrixXd right_hand_sides) const {
  const Eigen::VectorXd sizes = norms(right_hand_sides);
  remove(mass_null_space, null_space, right_hand_sides);
  Eigen::MatrixXd solutions = Eigen::MatrixXd::Zero(right_hand_sides.rows(), right_hand_sides.cols());
  for (Eigen::Index k = 0; k < solutions.cols(); ++k) {
    const VecHandle b = view(right_hand_sides.col(k)), x = view(solutions.col(k));
    check_petsc(KSPSetTolerances(iteration.get(), PETSC_DEFAULT, kRounding * sizes[k], PETSC_DEFAULT, PETSC_DEFAULT),
                "linear solver");
    check_petsc(KSPSolve(iteration.get(), b.get(), x.get()), "conjugate gradients");
    KSPConvergedReason reason = KSP_CONVERGED_ITERATING;
    PetscReal left = 0;
    PetscInt steps = 0;
    check_petsc(KSPGetConvergedReason(iteration.get(), &reason), "convergence");
    check_petsc(KSPGetResidualNorm(iteration.get(), &left), "convergence");
    check_petsc(KSPGetIterationNumber(iteration.get(), &steps), "convergence");
    if (reason < 0)
      throw WorkError("conjugate gradients: relative residual " + std::to_string(1e12 * left / sizes[k]) +
                      "e-12 after " + std::to_string(steps) +
                      " iterations; the mesh has bad elements, or parts that can move without deforming it");
  }
  remove(null_space, mass_null_space, solutions);
  return solutions;
}

SemidefiniteSolver::SemidefiniteSolver(const SparseMatrix& matrix, const Eigen::MatrixXd& mass_times_null_space,
                                       const std::string& name, const Eigen::MatrixXd& soft_fields) {
  start_solvers();
  Choice choice = choose(matrix, mass_times_null_space, soft_fields, name);
  const Call call{
      Task::kFactorise,
      new_share_id(),
      {matrix.rows(), mass_times_null_space.cols(), soft_fields.cols(), static_cast<std::int64_t>(choice.means)}};
  if (choice.means == Means::kMixed) {
    share_ = std::make_unique<SolverShare>(call);
    share_->mixed = std::move(choice.mixed);
    return;
  }
  announce(call);
  share_ = std::make_unique<SolverShare>(call);
  share_->factorise(matrix, mass_times_null_space, soft_fields);
  if (share_->means == Means::kMultigrid) return;
  PetscInt negative = 0, zero = 0, positive = 0;
  check_petsc(MatGetInertia(share_->factor.get(), &negative, &zero, &positive), "inertia");
  if (negative != share_->border || zero != 0)
    throw IllConditioned(
        name + ": expected " + std::to_string(share_->border) + " negative and no zero pivots, found " +
        std::to_string(negative) + " and " + std::to_string(zero) +
        ": parts of the body can move without deforming it (hinges, or tets joined only in an edge or a vertex)");
}

SemidefiniteSolver::~SemidefiniteSolver() = default;
SemidefiniteSolver::SemidefiniteSolver(SemidefiniteSolver&&) noexcept = default;

Eigen::Index SemidefiniteSolver::size() const { return share_->layout.size; }

Eigen::MatrixXd SemidefiniteSolver::solve(const Eigen::MatrixXd& right_hand_sides) const {
  Eigen::MatrixXd solutions(right_hand_sides.rows(), right_hand_sides.cols());
  const Eigen::Index together = share_->means == Means::kMixed ? kSolvedTogetherMixed : kSolvedTogether;
  for (Eigen::Index begin = 0; begin < solutions.cols(); begin += together) {
    const Eigen::Index count = std::min(together, solutions.cols() - begin);
    if (share_->mixed) {
      put_by_columns(share_->mixed->solve(by_rows(right_hand_sides.middleCols(begin, count))),
                     solutions.middleCols(begin, count));
      continue;
    }
    announce({Task::kSolve, share_->id, {count}});
    solutions.middleCols(begin, count) = share_->solve(right_hand_sides.middleCols(begin, count), count);
  }
  return solutions;
}

}  // namespace exmat::precompute
