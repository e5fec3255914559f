#include "precompute/solvers/eigenpairs.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <random>
#include <vector>

#include "common/core/error.h"
#include "common/core/progress.h"
#include "precompute/solvers/petsc_handles.h"

namespace exmat::precompute {
namespace {

constexpr double kConvergence = 1e-12;   // of Krylov-Schur, relative to the eigenvalue
constexpr double kResidualLimit = 1e-9;  // of the returned pairs
constexpr double kMissedMargin = 1e-7;   // a find below (1 - this) times the largest kept value was missed

using Columns = Eigen::Map<const Eigen::VectorXd>;

// y = K^+ x.
PetscErrorCode apply_inverse(PC preconditioner, Vec x, Vec y) {
  const SemidefiniteSolver* solver = nullptr;
  check_petsc(PCShellGetContext(preconditioner, &solver), "context");
  const PetscScalar* input = nullptr;
  PetscScalar* output = nullptr;
  check_petsc(VecGetArrayRead(x, &input), "vector");
  check_petsc(VecGetArrayWrite(y, &output), "vector");
  Eigen::Map<Eigen::VectorXd>(output, solver->size()) = solver->solve(Columns(input, solver->size()));
  check_petsc(VecRestoreArrayRead(x, &input), "vector");
  check_petsc(VecRestoreArrayWrite(y, &output), "vector");
  return 0;
}

PetscErrorCode report_progress(EPS, PetscInt, PetscInt converged, PetscScalar*, PetscScalar*, PetscReal*, PetscInt,
                               void* progress) {
  static_cast<Progress*>(progress)->reach(converged);
  return 0;
}

// Shift and invert at zero, the inverse being that of the solver.
void set_transformation(EPS eps, const SemidefiniteSolver& solver) {
  check_petsc(EPSSetTarget(eps, 0.0), "target");
  check_petsc(EPSSetWhichEigenpairs(eps, EPS_TARGET_MAGNITUDE), "order");
  ST transform = nullptr;
  KSP linear = nullptr;
  PC inverse = nullptr;
  check_petsc(EPSGetST(eps, &transform), "spectral transformation");
  check_petsc(STSetType(transform, STSINVERT), "spectral transformation");
  check_petsc(STGetKSP(transform, &linear), "linear solver");
  check_petsc(KSPSetType(linear, KSPPREONLY), "linear solver");
  check_petsc(KSPGetPC(linear, &inverse), "inverse");
  check_petsc(PCSetType(inverse, PCSHELL), "inverse");
  check_petsc(PCShellSetContext(inverse, const_cast<SemidefiniteSolver*>(&solver)), "inverse");
  check_petsc(PCShellSetApply(inverse, apply_inverse), "inverse");
}

VecHandle to_vec(const Eigen::VectorXd& values) {
  VecHandle vector;
  check_petsc(VecCreateSeq(PETSC_COMM_SELF, static_cast<PetscInt>(values.size()), vector.out()), "vector");
  PetscScalar* data = nullptr;
  check_petsc(VecGetArrayWrite(vector.get(), &data), "vector");
  std::copy(values.data(), values.data() + values.size(), data);
  check_petsc(VecRestoreArrayWrite(vector.get(), &data), "vector");
  return vector;
}

// Every start has components along all eigenvectors, and is the same in every run.
Eigen::VectorXd start_vector(Eigen::Index size, unsigned seed) {
  std::mt19937_64 generator(seed);
  Eigen::VectorXd start(size);
  for (double& entry : start) entry = static_cast<double>(generator()) / 0x1p63 - 1.0;
  return start;
}

// One Krylov-Schur run in the M-complement of the columns of `found`.
Eigen::MatrixXd krylov_schur(Mat stiffness, Mat mass, const SemidefiniteSolver& solver, const Eigen::MatrixXd& found,
                             Eigen::Index count) {
  EpsHandle eps;
  check_petsc(EPSCreate(PETSC_COMM_SELF, eps.out()), "eigensolver");
  check_petsc(EPSSetOperators(eps.get(), stiffness, mass), "operators");
  check_petsc(EPSSetProblemType(eps.get(), EPS_GHEP), "problem type");
  check_petsc(EPSSetType(eps.get(), EPSKRYLOVSCHUR), "eigensolver type");
  check_petsc(EPSSetDimensions(eps.get(), static_cast<PetscInt>(count), PETSC_DEFAULT, PETSC_DEFAULT), "dimensions");
  check_petsc(EPSSetTolerances(eps.get(), kConvergence, 1000), "tolerance");
  set_transformation(eps.get(), solver);

  std::vector<VecHandle> deflation;
  std::vector<Vec> raw;
  for (Eigen::Index k = 0; k < found.cols(); ++k) raw.push_back(deflation.emplace_back(to_vec(found.col(k))).get());
  check_petsc(EPSSetDeflationSpace(eps.get(), static_cast<PetscInt>(raw.size()), raw.data()), "deflation");
  const auto start = to_vec(solver.solve(start_vector(solver.size(), 1 + static_cast<unsigned>(found.cols()))));
  Vec raw_start = start.get();
  check_petsc(EPSSetInitialSpace(eps.get(), 1, &raw_start), "start vector");
  Progress progress("eigenpairs", count);
  check_petsc(EPSMonitorSet(eps.get(), report_progress, &progress, nullptr), "monitor");
  check_petsc(EPSSolve(eps.get()), "eigensolution");

  PetscInt converged = 0;
  check_petsc(EPSGetConverged(eps.get(), &converged), "convergence");
  if (converged < count)
    throw WorkError("eigensolver: expected " + std::to_string(count) + " eigenpairs, found " +
                    std::to_string(converged) + "; ask for fewer, or refine the mesh");
  const auto vector = to_vec(start_vector(solver.size(), 1));
  Eigen::MatrixXd vectors(solver.size(), count);
  for (Eigen::Index k = 0; k < count; ++k) {
    check_petsc(EPSGetEigenvector(eps.get(), static_cast<PetscInt>(k), vector.get(), nullptr), "eigenvector");
    const PetscScalar* data = nullptr;
    check_petsc(VecGetArrayRead(vector.get(), &data), "vector");
    vectors.col(k) = Columns(data, vectors.rows());
    check_petsc(VecRestoreArrayRead(vector.get(), &data), "vector");
  }
  return vectors;
}

// One step of inverse iteration and Rayleigh-Ritz: orthonormal to rounding, residuals far below Krylov-Schur's.
Eigenpairs polish(const SparseMatrix& stiffness, const SparseMatrix& mass, const SemidefiniteSolver& solver,
                  const Eigen::MatrixXd& vectors) {
  const Eigen::MatrixXd improved = solver.solve(mass * vectors);
  const Eigen::MatrixXd K = improved.transpose() * (stiffness * improved);
  const Eigen::MatrixXd M = improved.transpose() * (mass * improved);
  const Eigen::GeneralizedSelfAdjointEigenSolver<Eigen::MatrixXd> ritz(K, M);
  Eigenpairs pairs{ritz.eigenvalues(), improved * ritz.eigenvectors(), {}};
  // The Ritz vectors inherit the conditioning of `improved`; a second orthonormalisation removes it.
  const Eigen::MatrixXd gram = pairs.vectors.transpose() * (mass * pairs.vectors);
  gram.llt().matrixU().solveInPlace<Eigen::OnTheRight>(pairs.vectors);
  const Eigen::MatrixXd mass_vectors = mass * pairs.vectors;
  const Eigen::MatrixXd scaled = mass_vectors * pairs.values.asDiagonal();
  pairs.residuals =
      ((stiffness * pairs.vectors - scaled).colwise().norm().array() / scaled.colwise().norm().array()).transpose();
  return pairs;
}

}  // namespace

Eigenpairs smallest_eigenpairs(const SparseMatrix& stiffness, const SparseMatrix& mass,
                               const SemidefiniteSolver& solver, Eigen::Index count) {
  const MatHandle petsc_stiffness = to_petsc(stiffness, {}), petsc_mass = to_petsc(mass, {});
  Eigen::MatrixXd found = krylov_schur(petsc_stiffness.get(), petsc_mass.get(), solver, {}, count);
  Eigenpairs pairs = polish(stiffness, mass, solver, found);
  for (;;) {
    const Eigen::MatrixXd extra = krylov_schur(petsc_stiffness.get(), petsc_mass.get(), solver, pairs.vectors, 1);
    const Eigen::VectorXd x = extra.col(0);
    if (x.dot(stiffness * x) / x.dot(mass * x) >= (1 - kMissedMargin) * pairs.values[count - 1]) break;
    found.resize(found.rows(), count + 1);
    found << pairs.vectors, extra;
    pairs = polish(stiffness, mass, solver, found);
    pairs = {pairs.values.head(count), pairs.vectors.leftCols(count), pairs.residuals.head(count)};
  }
  if (pairs.residuals.maxCoeff() > kResidualLimit)
    throw WorkError("eigensolver: residual " + std::to_string(pairs.residuals.maxCoeff()) +
                    " is above 1e-9; the mesh has very bad elements");
  fix_signs(pairs.vectors);
  return pairs;
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
