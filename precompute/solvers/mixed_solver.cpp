#include "precompute/solvers/mixed_solver.h"

#include <algorithm>
#include <random>
#include <utility>
#include <vector>

#include "common/core/decompositions.h"
#include "common/core/error.h"
#include "precompute/solvers/tall.h"

namespace exmat::precompute {
namespace {

// Accuracy of a solution, in the norm of K.
constexpr double kTolerance = 1e-12;
// Steps of conjugate gradients: a good body takes 3 to 6. Where the first solution takes more than the first of these,
// factors in double are cheaper.
constexpr int kWorthwhile = 40, kMostIterations = 200;
// Limit of |B - K X| / |B| for the first solution. A null vector that is not R's would leave a thousand times as
// much.
constexpr double kSolved = 1e-6;

// Rows that hold the null space still: those of the largest volume, as pivoting chooses them.
std::vector<Eigen::Index> holding_rows(const Eigen::MatrixXd& null_space) {
  std::vector<Eigen::Index> rows;
  if (null_space.cols() == 0) return rows;
  const Eigen::ColPivHouseholderQR<Eigen::MatrixXd> factors(null_space.transpose());
  for (Eigen::Index k = 0; k < null_space.cols(); ++k) rows.push_back(factors.colsPermutation().indices()[k]);
  std::sort(rows.begin(), rows.end());
  return rows;
}

}  // namespace

MixedSolver::MixedSolver(SparseMatrix matrix, Eigen::MatrixXd null_space, Eigen::MatrixXd mass_times_null_space,
                         int block, std::shared_ptr<const Elimination> plan)
    : matrix_(std::move(matrix)),
      null_space_(null_space),
      mass_null_space_(mass_times_null_space),
      factors_(std::move(plan), block) {
  objection_ = factors_.factorise(matrix_, holding_rows(null_space))
                   ? object()
                   : "the matrix is not positive definite in single precision";
}

// By loads that have a share in every vector.
std::string MixedSolver::object() const {
  std::mt19937_64 generator(1);
  RowMatrix loads(matrix_.rows(), 1);
  for (Eigen::Index row = 0; row < loads.rows(); ++row) loads(row, 0) = static_cast<double>(generator()) / 0x1p63 - 1.0;
  add_product(-1, mass_null_space_, inner(null_space_, loads), loads);
  const Outcome outcome = iterate(loads, kWorthwhile);
  const RowMatrix left = loads - product(matrix_, outcome.solutions);
  if (outcome.converged && left.norm() <= kSolved * loads.norm()) return "";
  return "with factors in single precision " + std::to_string(outcome.steps) + " steps do not solve for it";
}

void MixedSolver::precondition(RowMatrix& right_hand_sides) const {
  add_product(-1, mass_null_space_, inner(null_space_, right_hand_sides), right_hand_sides);
  factors_.solve(right_hand_sides, right_hand_sides);
  add_product(-1, null_space_, inner(mass_null_space_, right_hand_sides), right_hand_sides);
}

void MixedSolver::precondition(const RowMatrix& residual, RowMatrix& solutions) const {
  if (nullity() > 0) {
    solutions = residual;
    return precondition(solutions);
  }
  factors_.solve(residual, solutions);
}

// Preconditioned conjugate gradients of each column, side by side. Hestenes and Stiefel 1952.
MixedSolver::Outcome MixedSolver::iterate(RowMatrix residual, int most) const {
  add_product(-1, mass_null_space_, inner(null_space_, residual), residual);
  Outcome outcome{RowMatrix::Zero(residual.rows(), residual.cols())};
  RowMatrix direction, image, solved;
  precondition(residual, direction);
  const Eigen::RowVectorXd ones = Eigen::RowVectorXd::Ones(residual.cols());
  Eigen::RowVectorXd square = column_dots(residual, direction);
  const Eigen::RowVectorXd limit = kTolerance * kTolerance * square;
  for (;; ++outcome.steps) {
    const auto open = (square.array() > limit.array()).eval();
    outcome.converged = !open.any();
    if (outcome.converged || outcome.steps == most) return outcome;
    product(matrix_, direction, image);
    const Eigen::RowVectorXd curvature = column_dots(direction, image);
    if (!curvature.allFinite() || (open && curvature.array() <= 0).any()) return outcome;
    const Eigen::RowVectorXd length = open.select(square.cwiseQuotient(curvature), 0);
    combine(ones, length, direction, outcome.solutions);
    combine(ones, -length, image, residual);
    precondition(residual, solved);
    const Eigen::RowVectorXd next = open.select(column_dots(residual, solved), square);
    const Eigen::RowVectorXd share = open.select(next.cwiseQuotient(square), 0);
    combine(share, ones, solved, direction);
    square = next;
  }
}

RowMatrix MixedSolver::solve(RowMatrix right_hand_sides) const {
  Outcome outcome = iterate(std::move(right_hand_sides), kMostIterations);
  if (!outcome.converged)
    throw WorkError("conjugate gradients with factors in single precision do not converge in " +
                    std::to_string(outcome.steps) + " steps; use --eigensolver direct");
  return std::move(outcome.solutions);
}

}  // namespace exmat::precompute
