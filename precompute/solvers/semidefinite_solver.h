#pragma once

#include <Eigen/Core>
#include <memory>
#include <string>

#include "common/core/error.h"
#include "common/mesh/assembly.h"

namespace exmat::precompute {

/// "PETSc 3.18.5, SLEPc 3.18.2".
std::string solver_versions();

/// A failure that a matrix is to blame for: that of a mesh with flat tets, with hinges, or of a very slender body.
class IllConditioned : public WorkError {
 public:
  using WorkError::WorkError;
};

struct SolverShare;

/// Solves with a symmetric positive semi-definite matrix K whose null space is the span of the M-orthonormal columns of
/// R, its rows over all ranks: by one direct factorisation (MUMPS through PETSc, L D L^T) of the bordered matrix
/// [[K, M R], [(M R)^T, 0]], of K itself without a null space; of large matrices and with Eigensolver::kMixed by
/// factors in single precision with conjugate gradients, for which it keeps a copy of K; with kGamg and kLobpcg, and
/// where factors do not fit into the memory, by conjugate gradients with algebraic multigrid (PETSc's GAMG). The log
/// says which, but for the first.
class SemidefiniteSolver {
 public:
  /// `soft_fields` [n x k] deform next to nothing, which multigrid has to know: R where there is a null space, else the
  /// rigid motions of elasticity; none: not known. `name` is for messages. Throws IllConditioned unless the inertia of
  /// the factors shows that K is positive semi-definite and has no other null vectors; multigrid cannot tell.
  SemidefiniteSolver(const SparseMatrix& matrix, const Eigen::MatrixXd& mass_times_null_space, const std::string& name,
                     const Eigen::MatrixXd& soft_fields = {});
  ~SemidefiniteSolver();
  SemidefiniteSolver(SemidefiniteSolver&&) noexcept;

  Eigen::Index size() const;

  /// [n x k] solutions X of K X = (I - M R R^T) B with R^T M X = 0, for [n x k] right-hand sides B. Throws WorkError
  /// where conjugate gradients do not converge.
  Eigen::MatrixXd solve(const Eigen::MatrixXd& right_hand_sides) const;

  /// For precompute/solvers.
  SolverShare& share() const { return *share_; }

 private:
  std::unique_ptr<SolverShare> share_;
};

}  // namespace exmat::precompute
