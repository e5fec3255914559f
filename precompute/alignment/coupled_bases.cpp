#include "precompute/alignment/coupled_bases.h"

#include "precompute/alignment/aligned_shape.h"

namespace exmat::precompute {
namespace {

constexpr int kMostSteps = 400;
constexpr double kConverged = 1e-7;  // relative decrease of the objective in a step
constexpr double kArmijo = 1e-4;
constexpr double kSmallestStep = 1e-12;

Eigen::MatrixXd off_diagonal(Eigen::MatrixXd matrix) {
  matrix.diagonal().setZero();
  return matrix;
}

double off(const Eigen::VectorXd& lambda, const Eigen::MatrixXd& basis) {
  return off_diagonal(basis.transpose() * lambda.asDiagonal() * basis).squaredNorm();
}

Eigen::MatrixXd off_gradient(const Eigen::VectorXd& lambda, const Eigen::MatrixXd& basis) {
  const Eigen::MatrixXd weighted = lambda.asDiagonal() * basis;
  return 4 * weighted * off_diagonal(basis.transpose() * weighted);
}

// Onto the tangent space of the matrices with orthonormal columns.
Eigen::MatrixXd tangent(const Eigen::MatrixXd& basis, const Eigen::MatrixXd& gradient) {
  const Eigen::MatrixXd product = basis.transpose() * gradient;
  return gradient - basis * (0.5 * (product + product.transpose()));
}

}  // namespace

double coupling_objective(const CouplingProblem& problem, const Eigen::MatrixXd& A, const Eigen::MatrixXd& B) {
  const double scale = problem.lambda_a[problem.lambda_a.size() - 1];
  return off(problem.lambda_a / scale, A) + off(problem.lambda_b / scale, B) +
         problem.coupling * (problem.F.transpose() * A - problem.G.transpose() * B).squaredNorm();
}

CouplingGradient coupling_gradient(const CouplingProblem& problem, const Eigen::MatrixXd& A, const Eigen::MatrixXd& B) {
  const double scale = problem.lambda_a[problem.lambda_a.size() - 1];
  const Eigen::MatrixXd difference = 2 * problem.coupling * (problem.F.transpose() * A - problem.G.transpose() * B);
  return {off_gradient(problem.lambda_a / scale, A) + problem.F * difference,
          off_gradient(problem.lambda_b / scale, B) - problem.G * difference};
}

CoupledBases couple_bases(const CouplingProblem& problem, const Eigen::MatrixXd& start) {
  const Eigen::Index size = problem.lambda_a.size();
  CoupledBases bases{Eigen::MatrixXd::Identity(size, size), start.transpose(), {}};
  bases.objective.push_back(coupling_objective(problem, bases.A, bases.B));
  double step = 0.1;
  for (int k = 0; k < kMostSteps; ++k) {
    const CouplingGradient gradient = coupling_gradient(problem, bases.A, bases.B);
    const Eigen::MatrixXd down_A = tangent(bases.A, gradient.A), down_B = tangent(bases.B, gradient.B);
    const double slope = down_A.squaredNorm() + down_B.squaredNorm();
    const double current = bases.objective.back();
    for (step *= 2; step > kSmallestStep; step /= 2) {
      const Eigen::MatrixXd A = polar_factor(bases.A - step * down_A), B = polar_factor(bases.B - step * down_B);
      const double next = coupling_objective(problem, A, B);
      if (next > current - kArmijo * step * slope) continue;
      bases.A = A;
      bases.B = B;
      bases.objective.push_back(next);
      break;
    }
    if (bases.objective.back() > current * (1 - kConverged)) break;
  }
  return bases;
}

}  // namespace exmat::precompute
