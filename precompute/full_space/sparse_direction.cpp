#include "precompute/full_space/sparse_direction.h"

#include <algorithm>
#include <cmath>

namespace exmat::precompute {
namespace {

constexpr double kTolerance = 1e-5;           // of the residual; Newton's method has the rest
constexpr int kMostIterations = 500;          // with fresh factors
constexpr int kLeastWorthwhile = 6;           // iterations with older ones
constexpr double kIterationsPerFactor = 0.1;  // of those that make as many operations as a factorisation, which has
                                              // products of matrices alone
constexpr double kFirstShift = 1e-6;          // times the largest diagonal entry
constexpr int kShifts = 12;

}  // namespace

SparseDirection::SparseDirection(const LowerTriangle& pattern)
    : factors_(pattern),
      // An iteration has four operations per entry of L.
      worthwhile_(std::max(kLeastWorthwhile, static_cast<int>(kIterationsPerFactor * factors_.operations() /
                                                              (4.0 * static_cast<double>(factors_.entries()))))) {}

bool SparseDirection::factorise(const LowerTriangle& matrix) {
  ++factorisations_;
  has_factors_ = factors_.factorise(matrix);
  return has_factors_;
}

// Preconditioned conjugate gradients from 0. Hestenes and Stiefel 1952.
SparseDirection::Outcome SparseDirection::iterate(const Product& product, const Eigen::VectorXd& b, int most,
                                                  Eigen::VectorXd& x) {
  x.setZero(b.size());
  Eigen::VectorXd residual = b, solved = factors_.solve(b), direction = solved;
  double square = residual.dot(solved);
  const double limit = kTolerance * b.norm();
  for (int iteration = 0; residual.norm() > limit; ++iteration) {
    if (iteration == most) return Outcome::kTooLong;
    ++iterations_;
    const Eigen::VectorXd image = product(direction);
    const double curvature = direction.dot(image);
    if (!(curvature > 0)) return Outcome::kIndefinite;
    const double length = square / curvature;
    x += length * direction;
    residual -= length * image;
    solved = factors_.solve(residual);
    const double next = residual.dot(solved);
    direction = solved + next / square * direction;
    square = next;
  }
  return Outcome::kSolved;
}

bool SparseDirection::solve(const LowerTriangle& matrix, const Product& product, const Eigen::VectorXd& b,
                            Eigen::VectorXd& x) {
  if (has_factors_ && iterate(product, b, worthwhile_, x) == Outcome::kSolved) return true;
  if (!factorise(matrix)) return false;
  return iterate(product, b, kMostIterations, x) != Outcome::kIndefinite;
}

bool SparseDirection::solve_shifted(LowerTriangle& matrix, const Product& product, const Eigen::VectorXd& b,
                                    Eigen::VectorXd& x) {
  if (solve(matrix, product, b, x)) return true;
  double shift = kFirstShift * matrix.diagonal().cwiseAbs().maxCoeff();
  for (int attempt = 0; attempt < kShifts; ++attempt, shift *= 10) {
    for (Eigen::Index i = 0; i < matrix.rows(); ++i) matrix.coeffRef(i, i) += shift;
    if (solve(matrix, product, b, x)) return true;
  }
  return false;
}

}  // namespace exmat::precompute
