#include "runtime/sim/frame/spin.h"

#include <Eigen/LU>
#include <cmath>
#include <limits>

namespace exmat::runtime {
namespace {

constexpr int kMaxIterations = 30;
constexpr double kSmall = 1e-4;       // [rad^2]
constexpr double kTolerance = 4e-15;  // residual over |l_n| + |h|
/// Share of the last squared residual; an iteration that leaves no more keeps its derivative.
constexpr double kServes = 1e-6;

struct Coefficients {
  double sine, cosine, third;  // sin t / t, (1 - cos t) / t^2, (t - sin t) / t^3
};

inline Coefficients coefficients(const Eigen::Vector3d& t) {
  const double square = t.squaredNorm();
  if (square < kSmall) {  // Taylor: the next term is below rounding
    return {1 - square / 6 * (1 - square / 20 * (1 - square / 42)),
            0.5 - square / 24 * (1 - square / 30 * (1 - square / 56)),
            1.0 / 6 - square / 120 * (1 - square / 42 * (1 - square / 72))};
  }
  const double angle = std::sqrt(square), half = std::sin(0.5 * angle) / angle;
  return {std::sin(angle) / angle, 2 * half * half, (angle - std::sin(angle)) / (angle * angle * angle)};
}

/// Derivative of the residual J w + h - l, l = exp(-[t]x) l_n: dl/dt = [l]x J_r(t), J_r the right Jacobian of SO(3).
Eigen::Matrix3d derivative(const SpinProblem& problem, const Eigen::Matrix3d& inertia, const Eigen::Vector3d& t,
                           const Coefficients& c, const Eigen::Vector3d& l) {
  Eigen::Matrix3d found = inertia;
  for (int axis = 0; axis < 3; ++axis) {
    const Eigen::Vector3d unit = Eigen::Vector3d::Unit(axis), once = t.cross(unit);
    found.col(axis) -= problem.factor * l.cross(unit - c.cosine * once + c.third * t.cross(once));
  }
  return found;
}

}  // namespace

Eigen::Matrix3d cross_matrix(const Eigen::Vector3d& w) noexcept {
  Eigen::Matrix3d matrix;
  matrix << 0, -w[2], w[1], w[2], 0, -w[0], -w[1], w[0], 0;
  return matrix;
}

Eigen::Matrix3d rotation_of(const Eigen::Vector3d& t) noexcept {
  const Coefficients c = coefficients(t);
  const Eigen::Matrix3d cross = cross_matrix(t);
  return Eigen::Matrix3d::Identity() + c.sine * cross + c.cosine * cross * cross;
}

Eigen::Quaterniond quaternion_of(const Eigen::Vector3d& t) noexcept {
  const double square = 0.25 * t.squaredNorm();
  if (square < kSmall) {
    const double share = 0.5 - square / 12 * (1 - square / 20 * (1 - square / 42));
    return {1 - square / 2 * (1 - square / 12 * (1 - square / 30)), share * t[0], share * t[1], share * t[2]};
  }
  const double half = std::sqrt(square), share = 0.5 * std::sin(half) / half;
  return {std::cos(half), share * t[0], share * t[1], share * t[2]};
}

Eigen::Matrix3d right_jacobian(const Eigen::Vector3d& t) noexcept {
  const Coefficients c = coefficients(t);
  const Eigen::Matrix3d cross = cross_matrix(t);
  return Eigen::Matrix3d::Identity() - c.cosine * cross + c.third * cross * cross;
}

SpinSolution solve_spin(const SpinProblem& problem, const Eigen::Matrix3d& inertia,
                        const Eigen::Vector3d& deformation_momentum, const Eigen::Vector3d& guess) noexcept {
  SpinSolution solution{guess, problem.offset + problem.factor * guess, false};
  const Eigen::Vector3d& momentum = problem.momentum;
  const double limit = kTolerance * (momentum.norm() + deformation_momentum.norm()), square = limit * limit;
  double before = std::numeric_limits<double>::infinity();
  Eigen::Matrix3d inverse = Eigen::Matrix3d::Zero();
  for (int iteration = 0; iteration < kMaxIterations; ++iteration) {
    const Eigen::Vector3d& t = solution.rotation;
    const Coefficients c = coefficients(t);
    const Eigen::Vector3d once = t.cross(momentum);
    const Eigen::Vector3d l = momentum - c.sine * once + c.cosine * t.cross(once);
    const Eigen::Vector3d residual = inertia * solution.spin + deformation_momentum - l;
    const double size = residual.squaredNorm();
    if (size <= square || (iteration > 3 && size >= before && size <= 1e6 * square)) {
      solution.converged = true;
      return solution;
    }
    if (iteration == 0 || !(size <= kServes * before)) inverse = derivative(problem, inertia, t, c, l).inverse();
    before = size;
    solution.spin -= inverse * residual;
    solution.rotation = problem.offset + problem.factor * solution.spin;
  }
  return solution;
}

}  // namespace exmat::runtime
