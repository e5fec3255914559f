#include "runtime/sim/frame/spin.h"

#include <Eigen/LU>
#include <cmath>
#include <limits>

namespace exmat::runtime {
namespace {

constexpr int kMaxIterations = 30;
constexpr double kTolerance = 4e-15;  // of |J w| + |h|

struct Coefficients {
  double sine, cosine, third;  // sin t / t, (1 - cos t) / t^2, (t - sin t) / t^3
};

Coefficients coefficients(double angle) {
  if (angle < 1e-2) {
    const double square = angle * angle;  // Taylor: the next term is below rounding
    return {1 - square / 6 * (1 - square / 20 * (1 - square / 42)),
            0.5 - square / 24 * (1 - square / 30 * (1 - square / 56)),
            1.0 / 6 - square / 120 * (1 - square / 42 * (1 - square / 72))};
  }
  const double half = std::sin(0.5 * angle) / angle;
  return {std::sin(angle) / angle, 2 * half * half, (angle - std::sin(angle)) / (angle * angle * angle)};
}

}  // namespace

Eigen::Matrix3d cross_matrix(const Eigen::Vector3d& w) noexcept {
  Eigen::Matrix3d matrix;
  matrix << 0, -w[2], w[1], w[2], 0, -w[0], -w[1], w[0], 0;
  return matrix;
}

Eigen::Matrix3d rotation_of(const Eigen::Vector3d& t) noexcept {
  const Coefficients c = coefficients(t.norm());
  const Eigen::Matrix3d cross = cross_matrix(t);
  return Eigen::Matrix3d::Identity() + c.sine * cross + c.cosine * cross * cross;
}

Eigen::Quaterniond quaternion_of(const Eigen::Vector3d& t) noexcept {
  const double half = 0.5 * t.norm();
  const double share = half > 1e-8 ? 0.5 * std::sin(half) / half : 0.5;
  return {std::cos(half), share * t[0], share * t[1], share * t[2]};
}

Eigen::Matrix3d right_jacobian(const Eigen::Vector3d& t) noexcept {
  const Coefficients c = coefficients(t.norm());
  const Eigen::Matrix3d cross = cross_matrix(t);
  return Eigen::Matrix3d::Identity() - c.cosine * cross + c.third * cross * cross;
}

SpinSolution solve_spin(const SpinProblem& problem, const Eigen::Matrix3d& inertia,
                        const Eigen::Vector3d& deformation_momentum, const Eigen::Vector3d& guess) noexcept {
  SpinSolution solution{guess, problem.offset + problem.factor * guess, false};
  const double scale = problem.momentum.norm() + deformation_momentum.norm();
  double before = std::numeric_limits<double>::infinity();
  for (int iteration = 0; iteration < kMaxIterations; ++iteration) {
    const Eigen::Vector3d& t = solution.rotation;
    const Coefficients c = coefficients(t.norm());
    const Eigen::Matrix3d cross = cross_matrix(t);
    const Eigen::Matrix3d square = cross * cross;
    const Eigen::Vector3d l =
        problem.momentum - c.sine * (cross * problem.momentum) + c.cosine * (square * problem.momentum);
    const Eigen::Vector3d residual = inertia * solution.spin + deformation_momentum - l;
    const double size = residual.norm();
    if (size <= kTolerance * scale || (iteration > 3 && size >= before && size <= 1e3 * kTolerance * scale)) {
      solution.converged = true;
      return solution;
    }
    before = size;
    // d(exp(-[t]) l_n)/dt = [l]x J_r(t), J_r the right Jacobian of SO(3).
    const Eigen::Matrix3d jacobian = inertia - problem.factor * cross_matrix(l) * right_jacobian(t);
    solution.spin -= jacobian.inverse() * residual;
    solution.rotation = problem.offset + problem.factor * solution.spin;
  }
  return solution;
}

}  // namespace exmat::runtime
