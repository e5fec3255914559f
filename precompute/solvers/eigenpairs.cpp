#include "precompute/solvers/eigenpairs.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <exception>
#include <optional>
#include <random>
#include <utility>
#include <vector>

#include "common/core/decompositions.h"
#include "common/core/error.h"
#include "common/core/log.h"
#include "common/core/progress.h"
#include "precompute/solvers/davidson.h"
#include "precompute/solvers/refinement.h"
#include "precompute/solvers/solver_access.h"

namespace exmat::precompute {
namespace {

constexpr double kConvergence = 1e-12;  // of Krylov-Schur, relative to the eigenvalue
// Accuracy of eigenvectors by Davidson's method, and of those that would show that one was missed: their values are off
// by the square of it.
constexpr double kDavidsonAccuracy = 1e-10, kMissedAccuracy = 1e-5;
constexpr double kLobpcgConvergence = 1e-9;  // |K x - lambda M x| / |lambda M x|, about
// Limit of |K x - lambda M x| / |lambda M x|. Rounding alone leaves eps |K| |x| / |lambda M x|, which is more for
// slender bodies and those with flat tets: their pairs are refined.
constexpr double kCoarse = 1e-9;
// Limits for the returned pairs: |lambda K^-1 M x - x| of those that were refined, what rounding of K makes of their
// eigenvalues, and the backward error of all.
constexpr double kChangeLimit = 1e-6, kRoundingLimit = 1e-3, kBackwardLimit = 1e-11;
constexpr int kMostPolishes = 4;        // one does after Krylov-Schur
constexpr double kMissedMargin = 1e-7;  // a find below (1 - this) times the largest kept value was missed

// y = K^+ x, of each rank's rows; `solve` does it.
template <typename Solve>
PetscErrorCode transform(Vec x, Vec y, Solve solve) {
  const PetscScalar* input = nullptr;
  PetscScalar* output = nullptr;
  PetscInt rows = 0;
  try {
    check_petsc(VecGetLocalSize(x, &rows), "vector");
    check_petsc(VecGetArrayRead(x, &input), "vector");
    check_petsc(VecGetArrayWrite(y, &output), "vector");
    Eigen::Map<Eigen::VectorXd>(output, rows) = solve(Eigen::Map<const Eigen::VectorXd>(input, rows));
    check_petsc(VecRestoreArrayRead(x, &input), "vector");
    check_petsc(VecRestoreArrayWrite(y, &output), "vector");
    return 0;
  } catch (const std::exception& error) {  // PETSc has to return before this is thrown on
    last_petsc_message() = error.what();
    return PETSC_ERR_USER;
  }
}

PetscErrorCode apply_inverse(PC preconditioner, Vec x, Vec y) {
  const SolverShare* solver = nullptr;
  const PetscErrorCode code = PCShellGetContext(preconditioner, &solver);
  if (code != 0) return code;
  return transform(x, y, [&](const auto& own) { return solver->solve_rows(own); });
}

PetscErrorCode apply_multigrid(PC preconditioner, Vec x, Vec y) {
  const SolverShare* solver = nullptr;
  PC multigrid = nullptr;
  PetscErrorCode code = PCShellGetContext(preconditioner, &solver);
  if (code == 0) code = KSPGetPC(solver->iteration.get(), &multigrid);
  return code != 0 ? code : PCApply(multigrid, x, y);
}

PetscErrorCode report_progress(EPS, PetscInt, PetscInt converged, PetscScalar*, PetscScalar*, PetscReal*, PetscInt,
                               void* progress) {
  static_cast<Progress*>(progress)->reach(converged);
  return 0;
}

// The linear solver of the transformation: one application of `apply`. Options of its kind are not for it.
void set_inverse(EPS eps, STType type, const SolverShare& solver, PetscErrorCode (*apply)(PC, Vec, Vec)) {
  ST transformation = nullptr;
  KSP linear = nullptr;
  PC inverse = nullptr;
  check_petsc(EPSGetST(eps, &transformation), "spectral transformation");
  check_petsc(STSetType(transformation, type), "spectral transformation");
  check_petsc(STGetKSP(transformation, &linear), "linear solver");
  check_petsc(KSPSetOptionsPrefix(linear, "inverse_"), "linear solver");
  check_petsc(KSPSetType(linear, KSPPREONLY), "linear solver");
  check_petsc(KSPGetPC(linear, &inverse), "inverse");
  check_petsc(PCSetType(inverse, PCSHELL), "inverse");
  check_petsc(PCShellSetContext(inverse, const_cast<SolverShare*>(&solver)), "inverse");
  check_petsc(PCShellSetApply(inverse, apply), "inverse");
}

// Shift and invert at zero, the inverse being that of the solver.
void set_krylov_schur(EPS eps, const SolverShare& solver) {
  check_petsc(EPSSetType(eps, EPSKRYLOVSCHUR), "eigensolver type");
  check_petsc(EPSSetTolerances(eps, kConvergence, 1000), "tolerance");
  check_petsc(EPSSetTarget(eps, 0.0), "target");
  check_petsc(EPSSetWhichEigenpairs(eps, EPS_TARGET_MAGNITUDE), "order");
  set_inverse(eps, STSINVERT, solver, apply_inverse);
}

void set_lobpcg(EPS eps, Mat mass, const SolverShare& solver) {
  // SLEPc compares |K x - lambda M x| with lambda, x^T M x = 1: then |M x| is about the root of a diagonal entry of M.
  PetscScalar trace = 0;
  check_petsc(MatGetTrace(mass, &trace), "trace of the mass");
  const double scale = std::sqrt(trace / static_cast<double>(solver.layout.size));
  check_petsc(EPSSetType(eps, EPSLOBPCG), "eigensolver type");
  check_petsc(EPSSetTolerances(eps, kLobpcgConvergence * scale, 5000), "tolerance");
  check_petsc(EPSSetConvergenceTest(eps, EPS_CONV_REL), "convergence test");
  check_petsc(EPSSetWhichEigenpairs(eps, EPS_SMALLEST_REAL), "order");
  set_inverse(eps, STPRECOND, solver, apply_multigrid);
}

VecHandle to_vec(const Eigen::Ref<const Eigen::VectorXd>& own) {
  VecHandle vector;
  check_petsc(VecCreate(team(), vector.out()), "vector");
  check_petsc(VecSetSizes(vector.get(), static_cast<PetscInt>(own.size()), PETSC_DETERMINE), "vector");
  check_petsc(VecSetType(vector.get(), VECSTANDARD), "vector");
  PetscScalar* data = nullptr;
  check_petsc(VecGetArrayWrite(vector.get(), &data), "vector");
  std::copy(own.data(), own.data() + own.size(), data);
  check_petsc(VecRestoreArrayWrite(vector.get(), &data), "vector");
  return vector;
}

std::vector<VecHandle> to_vecs(const Eigen::MatrixXd& own) {
  std::vector<VecHandle> vectors;
  for (Eigen::Index k = 0; k < own.cols(); ++k) vectors.push_back(to_vec(own.col(k)));
  return vectors;
}

std::vector<Vec> raw(const std::vector<VecHandle>& handles) {
  std::vector<Vec> vectors;
  for (const VecHandle& handle : handles) vectors.push_back(handle.get());
  return vectors;
}

// Every start has components along all eigenvectors, and is the same in every run.
Eigen::VectorXd start_vector(Eigen::Index size, unsigned seed) {
  std::mt19937_64 generator(seed);
  Eigen::VectorXd start(size);
  for (double& entry : start) entry = static_cast<double>(generator()) / 0x1p63 - 1.0;
  return start;
}

// [own rows x count] of the eigenvectors of a solved problem.
Eigen::MatrixXd eigenvectors(EPS eps, Eigen::Index own, Eigen::Index count) {
  PetscInt converged = 0;
  check_petsc(EPSGetConverged(eps, &converged), "convergence");
  if (converged < count)
    throw WorkError("eigensolver: expected " + std::to_string(count) + " eigenpairs, found " +
                    std::to_string(converged) + "; ask for fewer, or refine the mesh");
  const auto vector = to_vec(Eigen::VectorXd::Zero(own));
  Eigen::MatrixXd vectors(own, count);
  for (Eigen::Index k = 0; k < count; ++k) {
    check_petsc(EPSGetEigenvector(eps, static_cast<PetscInt>(k), vector.get(), nullptr), "eigenvector");
    const PetscScalar* data = nullptr;
    check_petsc(VecGetArrayRead(vector.get(), &data), "vector");
    vectors.col(k) = Eigen::Map<const Eigen::VectorXd>(data, own);
    check_petsc(VecRestoreArrayRead(vector.get(), &data), "vector");
  }
  return vectors;
}

// One run in the M-complement of the columns of `found`; each rank has its rows of all.
Eigen::MatrixXd solve_eigenproblem(const EigenShare& problem, const Eigen::MatrixXd& found,
                                   const Eigen::VectorXd& start, Eigen::Index count) {
  EpsHandle eps;
  check_petsc(EPSCreate(team(), eps.out()), "eigensolver");
  check_petsc(EPSSetOperators(eps.get(), problem.stiffness.get(), problem.mass.get()), "operators");
  check_petsc(EPSSetProblemType(eps.get(), EPS_GHEP), "problem type");
  check_petsc(EPSSetDimensions(eps.get(), static_cast<PetscInt>(count), PETSC_DEFAULT, PETSC_DEFAULT), "dimensions");
  // LOBPCG has less work than the other with multigrid; it is taken where the choice is ours.
  const bool lobpcg = problem.solver.means == Means::kMultigrid && solver_settings().eigensolver != Eigensolver::kGamg;
  lobpcg ? set_lobpcg(eps.get(), problem.mass.get(), problem.solver) : set_krylov_schur(eps.get(), problem.solver);

  std::vector<VecHandle> deflation = to_vecs(found);
  if (lobpcg)  // the inverse of the other leaves the null space out
    for (auto& field : to_vecs(problem.solver.null_space)) deflation.push_back(std::move(field));
  check_petsc(EPSSetDeflationSpace(eps.get(), static_cast<PetscInt>(deflation.size()), raw(deflation).data()),
              "deflation");
  const auto first = to_vec(start);
  Vec raw_first = first.get();
  check_petsc(EPSSetInitialSpace(eps.get(), 1, &raw_first), "start vector");
  if (!solver_settings().options.empty()) check_petsc(EPSSetFromOptions(eps.get()), "options of the eigensolver");
  Progress progress("eigenpairs", count);
  check_petsc(EPSMonitorSet(eps.get(), report_progress, &progress, nullptr), "monitor");
  check_petsc(EPSSolve(eps.get()), "eigensolution");
  return eigenvectors(eps.get(), start.size(), count);
}

// SLEPc's search does not end where eigenvalues are far below 1, as of very soft bodies: they are divided by this power
// of two of the size of the smallest, which takes no digit. Vectors stay what they are.
double share_of_mass(const SparseMatrix& stiffness, const SparseMatrix& mass, const SemidefiniteSolver& solver) {
  const Eigen::VectorXd smooth = solver.solve(start_vector(solver.size(), 1));
  const double size = rayleigh_quotient(stiffness, mass, smooth);
  return size < 1 && size > 0 ? std::exp2(std::floor(std::log2(size))) : 1;
}

// Calls work(). A Fault of it is one of the options, if some are given.
template <class Fault, class Work>
auto under_options(const Work& work) {
  try {
    return work();
  } catch (const Fault& fault) {
    if (solver_settings().options.empty()) throw;
    log::debug(fault.what());
    throw InputError({"command line", words_of_options(), "options by which the eigenpairs are found",
                      "values that the eigensolver refuses or fails with",
                      "mend their values, or leave them out; --log-level debug says why"});
  }
}

// The eigenproblem, on all ranks while it lives unless the leader has the factors.
class TeamProblem {
 public:
  TeamProblem(const SparseMatrix& stiffness, const SparseMatrix& mass, const SemidefiniteSolver& solver)
      : stiffness_(stiffness), mass_(mass), solver_(solver) {
    if (solver.share().mixed) return;
    const double share = share_of_mass(stiffness, mass, solver);  // with all ranks, before their next call
    const Call call{Task::kPoseEigenproblem, new_share_id(), {solver.share().id}};
    announce(call);
    share_.emplace(call, solver.share());
    share_->pose(stiffness, share * mass);
  }

  // `count` eigenvectors in the M-complement of the columns of `found`.
  Eigen::MatrixXd search(const Eigen::MatrixXd& found, Eigen::Index count) const {
    if (!share_)
      return davidson_eigenvectors(stiffness_, mass_, *solver_.share().mixed, found, count,
                                   found.cols() == 0 ? kDavidsonAccuracy : kMissedAccuracy);
    Eigen::MatrixXd fields(solver_.size(), found.cols() + 1);
    fields.leftCols(found.cols()) = found;
    fields.rightCols(1) = solver_.solve(start_vector(solver_.size(), 1 + static_cast<unsigned>(found.cols())));
    announce({Task::kSearch, share_->id, {found.cols(), count}});
    return under_options<WorkError>([&] {
      Eigen::MatrixXd vectors = share_->search(fields, found.cols(), count);
      require_options_taken();
      return vectors;
    });
  }

 private:
  const SparseMatrix &stiffness_, &mass_;
  const SemidefiniteSolver& solver_;
  std::optional<EigenShare> share_;
};

struct Polished {
  Eigenpairs pairs;
  double residual = 0;  // largest |K x - lambda M x| / |lambda M x|
};

// A step of inverse iteration and Rayleigh-Ritz: orthonormal to rounding, residuals far below Krylov-Schur's.
Polished polish_once(const SparseMatrix& stiffness, const SparseMatrix& mass, const SemidefiniteSolver& solver,
                     const Eigen::MatrixXd& vectors) {
  const Eigen::MatrixXd improved = solver.solve(mass * vectors);
  const Eigen::MatrixXd K = improved.transpose() * (stiffness * improved);
  const Eigen::MatrixXd M = improved.transpose() * (mass * improved);
  const Eigen::GeneralizedSelfAdjointEigenSolver<Eigen::MatrixXd> ritz(K, M);
  Eigenpairs pairs{ritz.eigenvalues(), improved * ritz.eigenvectors()};
  // The Ritz vectors inherit the conditioning of `improved`; a second orthonormalisation removes it.
  const Eigen::MatrixXd gram = pairs.vectors.transpose() * (mass * pairs.vectors);
  gram.llt().matrixU().solveInPlace<Eigen::OnTheRight>(pairs.vectors);
  const Eigen::MatrixXd mass_vectors = mass * pairs.vectors;
  const Eigen::MatrixXd scaled = mass_vectors * pairs.values.asDiagonal();
  const double residual =
      ((stiffness * pairs.vectors - scaled).colwise().norm().array() / scaled.colwise().norm().array()).maxCoeff();
  return {std::move(pairs), residual};
}

// Until the residuals are small, for those found by LOBPCG.
Polished polish(const SparseMatrix& stiffness, const SparseMatrix& mass, const SemidefiniteSolver& solver,
                const Eigen::MatrixXd& vectors) {
  Polished polished = polish_once(stiffness, mass, solver, vectors);
  for (int pass = 1; pass < kMostPolishes && polished.residual > kCoarse; ++pass)
    polished = polish_once(stiffness, mass, solver, polished.pairs.vectors);
  return polished;
}

std::string scientific(double value) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%.1e", value);
  return text.data();
}

void require(double found, double limit, const char* what) {
  if (found <= limit) return;
  throw IllConditioned(std::string("eigensolver: ") + what + " is " + scientific(found) + ", above " +
                       scientific(limit) + ": numbers of 16 digits do not hold this body");
}

void refine_where_coarse(const SparseMatrix& stiffness, const SparseMatrix& mass, const SemidefiniteSolver& solver,
                         Polished& polished) {
  Eigenpairs& pairs = polished.pairs;
  if (polished.residual > kCoarse) {
    RefinedPairs refined = refine(stiffness, mass, solver, pairs.values, pairs.vectors);
    pairs = {std::move(refined.values), std::move(refined.vectors)};
    require(rounding_share(stiffness, mass, pairs.values, pairs.vectors), kRoundingLimit,
            "the relative error of an eigenvalue by the rounding of the matrix");
    require(refined.change, kChangeLimit, "the relative change of an eigenvector by one more iteration");
  }
  require(backward_errors(stiffness, mass, pairs.values, pairs.vectors).maxCoeff(), kBackwardLimit,
          "the backward error");
}

/// All eigenpairs of the matrices as dense ones, less the null space: what searches of a few pairs end with where most
/// of them are asked for.
Eigenpairs dense_eigenpairs(const SparseMatrix& stiffness, const SparseMatrix& mass, const SemidefiniteSolver& solver,
                            Eigen::Index count) {
  const Eigen::GeneralizedSelfAdjointEigenSolver<Eigen::MatrixXd> all{Eigen::MatrixXd(stiffness),
                                                                      Eigen::MatrixXd(mass)};
  const Eigen::Index soft = solver.share().border, found = std::min(count, solver.size() - soft);
  if (found < count)
    throw WorkError("eigensolver: expected " + std::to_string(count) + " eigenpairs, found " + std::to_string(found) +
                    "; ask for fewer, or refine the mesh");
  Polished polished = polish(stiffness, mass, solver, all.eigenvectors().middleCols(soft, count));
  refine_where_coarse(stiffness, mass, solver, polished);
  fix_signs(polished.pairs.vectors);
  return std::move(polished.pairs);
}

/// Searches more than once, since one search may miss an eigenpair.
Eigenpairs search_eigenpairs(const SparseMatrix& stiffness, const SparseMatrix& mass, const SemidefiniteSolver& solver,
                             Eigen::Index count) {
  const TeamProblem problem(stiffness, mass, solver);
  Eigen::MatrixXd found = problem.search(Eigen::MatrixXd(solver.size(), 0), count);
  Polished polished = polish(stiffness, mass, solver, found);
  for (;;) {
    Eigenpairs& pairs = polished.pairs;
    const Eigen::MatrixXd extra = problem.search(pairs.vectors, 1);
    if (rayleigh_quotient(stiffness, mass, extra.col(0)) >= (1 - kMissedMargin) * pairs.values[count - 1]) break;
    found.resize(found.rows(), count + 1);
    found << pairs.vectors, extra;
    polished = polish(stiffness, mass, solver, found);
    pairs = {pairs.values.head(count), pairs.vectors.leftCols(count)};
  }
  refine_where_coarse(stiffness, mass, solver, polished);
  fix_signs(polished.pairs.vectors);
  return std::move(polished.pairs);
}

}  // namespace

EigenShare::EigenShare(const Call& call, SolverShare& used) : solver(used) { id = call.object; }

EigenShare::~EigenShare() { forget(id); }

void EigenShare::pose(const SparseMatrix& whole_stiffness, const SparseMatrix& whole_mass) {
  agree([&] {
    stiffness = to_petsc(solver.layout, whole_stiffness, {}, 0);
    mass = to_petsc(solver.layout, whole_mass, {}, 0);
  });
}

Eigen::MatrixXd EigenShare::search(const Eigen::MatrixXd& fields, Eigen::Index found, Eigen::Index count) const {
  Eigen::MatrixXd vectors;
  agree([&] {
    const Eigen::MatrixXd own = scatter_rows(solver.layout, fields, found + 1);
    vectors = gather_rows(solver.layout, solve_eigenproblem(*this, own.leftCols(found), own.col(found), count));
  });
  return vectors;
}

Eigenpairs smallest_eigenpairs(const SparseMatrix& stiffness, const SparseMatrix& mass,
                               const SemidefiniteSolver& solver, Eigen::Index count) {
  if (2 * (count + solver.share().border) >= solver.size()) return dense_eigenpairs(stiffness, mass, solver, count);
  return under_options<IllConditioned>([&] { return search_eigenpairs(stiffness, mass, solver, count); });
}

void fix_signs(Eigen::MatrixXd& columns) {
  for (auto column : columns.colwise()) {
    const double threshold = (1 - 1e-6) * column.cwiseAbs().maxCoeff();
    const double* leading = std::find_if(column.data(), column.data() + column.size(),
                                         [threshold](double entry) { return std::abs(entry) >= threshold; });
    if (*leading < 0) column = -column;
  }
}

bool splits_cluster(const Eigen::VectorXd& values, Eigen::Index count) {
  return values[count] - values[count - 1] < kClusterGap * values[count];
}

Eigen::Index next_uncut(const Eigen::VectorXd& values, Eigen::Index count) {
  while (++count < values.size() && splits_cluster(values, count)) {
  }
  return count;
}

}  // namespace exmat::precompute
