#pragma once

#include <Eigen/Core>
#include <memory>
#include <string>

#include "precompute/fem/assembly.h"

namespace exmat::precompute {

/// "PETSc 3.18.5, SLEPc 3.18.2".
std::string solver_versions();

/// One direct factorisation (MUMPS through PETSc, L D L^T) of a symmetric positive semi-definite matrix K whose null
/// space is the span of the M-orthonormal columns of R: of the bordered matrix [[K, M R], [(M R)^T, 0]]. Without a null
/// space, of K itself.
class SemidefiniteSolver {
 public:
  /// `name` is for messages. Throws WorkError unless the inertia of the factors shows that K is positive semi-definite
  /// and has no other null vectors.
  SemidefiniteSolver(const SparseMatrix& matrix, const Eigen::MatrixXd& mass_times_null_space, const std::string& name);
  ~SemidefiniteSolver();
  SemidefiniteSolver(SemidefiniteSolver&&) noexcept;

  Eigen::Index size() const;

  /// [n x k] solutions X of K X = (I - M R R^T) B with R^T M X = 0, for [n x k] right-hand sides B.
  Eigen::MatrixXd solve(const Eigen::MatrixXd& right_hand_sides) const;

 private:
  struct Implementation;
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace exmat::precompute
