#pragma once

// Private to precompute/solvers: what each rank holds of a solver and of an eigenproblem. Members are collective, and
// take what is the leader's from the leader alone.

#include <memory>

#include "precompute/solvers/mixed_solver.h"
#include "precompute/solvers/semidefinite_solver.h"
#include "precompute/solvers/team.h"

namespace exmat::precompute {

/// Method of a solver.
enum class Means : std::int64_t {
  kMumps,      ///< factors in double
  kMixed,      ///< factors in single precision, on the leader alone
  kMultigrid,  ///< conjugate gradients with multigrid
};

struct SolverShare : Share {
  explicit SolverShare(const Call& call);
  ~SolverShare() override;

  void factorise(const SparseMatrix& matrix, const Eigen::MatrixXd& mass_times_null_space,
                 const Eigen::MatrixXd& soft_fields);
  /// [n x columns] on the leader.
  Eigen::MatrixXd solve(const Eigen::MatrixXd& right_hand_sides, Eigen::Index columns) const;
  /// [own rows x k] of each rank's own.
  Eigen::MatrixXd solve_rows(const Eigen::MatrixXd& right_hand_sides) const;

  Layout layout;
  Eigen::Index border = 0, soft = 0;  ///< columns of R, of the soft fields
  Means means = Means::kMumps;
  std::unique_ptr<MixedSolver> mixed;
  MatHandle matrix;     ///< matrix for multigrid alone
  MatHandle factor;     ///< factor of the bordered matrix, by MUMPS
  KspHandle iteration;  ///< conjugate gradients
  MatHandle shifted;    ///< without null vectors, for multigrid
  NullSpaceHandle soft_space;
  Eigen::MatrixXd null_space, mass_null_space;  ///< own rows of R and M R

 private:
  void factorise_directly(const SparseMatrix& matrix, const Eigen::MatrixXd& mass_times_null_space);
  void set_up_multigrid(const SparseMatrix& matrix, const Eigen::MatrixXd& mass_times_null_space,
                        const Eigen::MatrixXd& soft_fields);
  Eigen::MatrixXd solve_directly(const Eigen::MatrixXd& right_hand_sides) const;
  Eigen::MatrixXd iterate(Eigen::MatrixXd right_hand_sides) const;
};

struct EigenShare : Share {
  EigenShare(const Call& call, SolverShare& solver);
  ~EigenShare() override;

  void pose(const SparseMatrix& stiffness, const SparseMatrix& mass);
  /// [n x count] vectors on the leader; `fields` [n x (found + 1)] are those to stay orthogonal to, and a start.
  Eigen::MatrixXd search(const Eigen::MatrixXd& fields, Eigen::Index found, Eigen::Index count) const;

  SolverShare& solver;
  MatHandle stiffness, mass;
};

}  // namespace exmat::precompute
