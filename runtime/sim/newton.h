#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <cmath>
#include <limits>

#include "runtime/sim/profile.h"
#include "runtime/sim/reduced_elasticity.h"

namespace exmat::runtime {

struct NewtonSettings {
  int max_iterations = 20;
  double tolerance = 1e-6;  ///< |gradient| <= tolerance * scale of the evaluation
};

enum class NewtonStatus {
  kConverged,
  kIterationLimit,
  kStagnated,  ///< no lower value along the direction, or all of the decrease below rounding
  kNonFinite,  ///< x may hold anything
};

struct NewtonReport {
  NewtonStatus status = NewtonStatus::kConverged;
  int iterations = 0;
  int line_search_evaluations = 0;
  int projections = 0;  ///< times that the exact Hessian was not positive definite
  double residual = 0;  ///< |gradient| at the end
};

/// A potential and the size of the terms that add up to it, by which rounding is judged.
struct PotentialValue {
  double value = 0;
  double magnitude = 0;
};

/// At one point: the potential, and the force scale that the gradient is compared with.
struct PotentialEvaluation {
  PotentialValue potential;
  double force_scale = 0;
};

/// Of one size, allocated once.
struct NewtonWorkspace {
  explicit NewtonWorkspace(Eigen::Index size = 0)
      : gradient(size),
        direction(size),
        trial(size),
        hessian(Eigen::MatrixXd::Zero(size, size)),
        cholesky(Eigen::MatrixXd::Identity(size, size)) {
  }  // by size alone it could not be copied: its status is undefined

  Eigen::VectorXd gradient, direction, trial;
  Eigen::MatrixXd hessian;  ///< lower triangle
  Eigen::LLT<Eigen::MatrixXd> cholesky;
  Profile* profile = nullptr;
};

namespace detail {

inline constexpr double kArmijo = 1e-4;
inline constexpr int kHalvings = 30;
inline constexpr int kShifts = 12;
inline constexpr double kFirstShift = 1e-6;  // times the largest diagonal entry
inline constexpr double kRounding = 4 * std::numeric_limits<double>::epsilon();

inline bool factorize(NewtonWorkspace& workspace) {
  const StageTimer timer(workspace.profile, Stage::kSolve);
  workspace.cholesky.compute(workspace.hessian);
  return workspace.cholesky.info() == Eigen::Success;
}

/// A Hessian that even projected tangents leave indefinite is shifted until it is not.
inline bool factorize_shifted(NewtonWorkspace& workspace) {
  if (factorize(workspace)) return true;
  double shift = kFirstShift * workspace.hessian.diagonal().cwiseAbs().maxCoeff();
  for (int attempt = 0; attempt < kShifts; ++attempt, shift *= 10) {
    workspace.hessian.diagonal().array() += shift;
    if (factorize(workspace)) return true;
  }
  return false;
}

/// Armijo backtracking along workspace.direction; leaves the accepted point in workspace.trial.
template <class Problem>
bool line_search(Problem& problem, const Eigen::VectorXd& x, const PotentialValue& start, double slope,
                 NewtonWorkspace& workspace, NewtonReport& report) {
  const StageTimer timer(workspace.profile, Stage::kLineSearch);
  double length = 1;
  for (int halving = 0; halving <= kHalvings; ++halving, length *= 0.5) {
    workspace.trial.noalias() = x + length * workspace.direction;
    const PotentialValue value = problem.value(workspace.trial);
    ++report.line_search_evaluations;
    if (value.value <= start.value + kArmijo * length * slope + kRounding * start.magnitude) return true;
  }
  return false;
}

}  // namespace detail

/// Minimises a potential from `x` by Newton's method: exact Hessian and Cholesky, positive semi-definite element
/// tangents only where Cholesky fails, Armijo line search. reduction.md, "Integration". Problem offers, for x of the
/// workspace's size,
///   PotentialEvaluation gradient_and_hessian(x, gradient, hessian)   at the first iterate
///   PotentialEvaluation gradient(x, gradient)                        at every later one
///   void hessian(x, Tangent, hessian)                                lower triangle
///   PotentialValue value(x)
/// The gradient is evaluated anew after a hessian() of projected tangents, which may change what the problem keeps
/// frozen.
template <class Problem>
NewtonReport newton_minimize(Problem& problem, const NewtonSettings& settings, Eigen::VectorXd& x,
                             NewtonWorkspace& workspace) noexcept {
  NewtonReport report;
  auto& [gradient, direction, trial, hessian, cholesky, profile] = workspace;
  PotentialEvaluation here = problem.gradient_and_hessian(x, gradient, hessian);
  const auto finish = [&](NewtonStatus status) {
    report.status = status;
    return report;
  };
  double unchecked_from =
      std::numeric_limits<double>::infinity();  // residual before a step that no line search checked
  for (;;) {
    report.residual = gradient.norm();
    if (!std::isfinite(report.residual) || !std::isfinite(here.potential.value))
      return finish(NewtonStatus::kNonFinite);
    if (report.residual <= settings.tolerance * here.force_scale) return finish(NewtonStatus::kConverged);
    if (report.residual > 0.5 * unchecked_from) return finish(NewtonStatus::kStagnated);
    if (report.iterations == settings.max_iterations) return finish(NewtonStatus::kIterationLimit);

    if (report.iterations > 0) problem.hessian(x, Tangent::kExact, hessian);
    if (!detail::factorize(workspace)) {
      ++report.projections;
      problem.hessian(x, Tangent::kPositiveSemidefinite, hessian);
      here = problem.gradient(x, gradient);
      if (!detail::factorize_shifted(workspace)) return finish(NewtonStatus::kNonFinite);
    }
    {
      const StageTimer timer(profile, Stage::kSolve);
      direction = -gradient;
      cholesky.solveInPlace(direction);
    }
    const double slope = gradient.dot(direction);
    if (!std::isfinite(slope)) return finish(NewtonStatus::kNonFinite);
    const bool below_rounding = -slope <= detail::kRounding * here.potential.magnitude;
    unchecked_from = below_rounding ? report.residual : std::numeric_limits<double>::infinity();
    if (below_rounding) {
      // The potential cannot tell the two points apart, yet the gradient can: go on for as long as it falls.
      trial = x + direction;
    } else if (!detail::line_search(problem, x, here.potential, slope, workspace, report)) {
      return finish(NewtonStatus::kStagnated);
    }
    x.swap(trial);
    ++report.iterations;
    here = problem.gradient(x, gradient);
  }
}

}  // namespace exmat::runtime
