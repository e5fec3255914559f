#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "common/core/decompositions.h"
#include "runtime/kernels/aligned_array.h"
#include "runtime/sim/elasticity/element_potential.h"
#include "runtime/sim/solver/line_search.h"
#include "runtime/sim/solver/profile.h"

namespace exmat::runtime {

struct NewtonSettings {
  int max_iterations = 200;
  double tolerance = 1e-6;  ///< |gradient| <= tolerance * scale of the evaluation
  /// An earlier factor serves while an iteration leaves at most this share of the residual, and so many more are
  /// expected at most: what a new Hessian costs, in iterations without one.
  double chord_rate = 0.25, chord_steps = 4;
};

/// Faults that a test plants, to see that it notices them; no file sets one.
struct NewtonPolicy {
  bool line_search = true;  ///< false: every full step is taken
  bool projection = true;   ///< false: stagnates where the exact Hessian is not positive definite
};

enum class NewtonBegin { kHessian, kFactor };

enum class NewtonStatus {
  kConverged,
  kIterationLimit,
  kStagnated,   ///< no lower value along the direction, or all of the decrease below rounding
  kNonFinite,   ///< x may hold anything
  kAboveStart,  ///< a minimum that lies above where the bodies stand, which is none of theirs
};

struct NewtonReport {
  NewtonStatus status = NewtonStatus::kConverged;
  int iterations = 0;
  int factorisations = 0;           ///< Hessians factored; fewer than iterations where an older one served
  int line_search_evaluations = 0;  ///< beyond the one that each iteration needs
  int projections = 0;              ///< times that the exact Hessian was not positive definite
  double residual = 0;              ///< |gradient| at the end
  double force_scale = 0;           ///< that of the last evaluation
};

/// Why a minimisation ends at an iterate; nothing where it goes on. `unchecked_from` is the residual before a step that
/// no line search checked, else infinity.
inline std::optional<NewtonStatus> reason_to_end(const NewtonReport& report, const NewtonSettings& settings,
                                                 const PotentialEvaluation& here, double unchecked_from) {
  if (!std::isfinite(report.residual) || !std::isfinite(here.potential.value)) return NewtonStatus::kNonFinite;
  if (report.residual <= settings.tolerance * here.force_scale) return NewtonStatus::kConverged;
  if (report.residual > 0.5 * unchecked_from) return NewtonStatus::kStagnated;
  if (report.iterations == settings.max_iterations) return NewtonStatus::kIterationLimit;
  return std::nullopt;
}

/// Memory of a solution of one size, allocated once.
struct NewtonWorkspace {
  explicit NewtonWorkspace(Eigen::Index size = 0)
      : gradient(size),
        trial(size),
        trial_gradient(size),
        hessian(Eigen::MatrixXd::Zero(size, size)),
        factor(size * padded(size)),
        direction(size) {}

  /// For a problem that keeps its Hessian itself.
  void resize_vectors(Eigen::Index size) {
    gradient.resize(size);
    trial.resize(size);
    trial_gradient.resize(size);
    if (direction.size() < size) direction = AlignedArray(size);
  }

  Eigen::VectorXd gradient, trial, trial_gradient;
  Eigen::MatrixXd hessian;  ///< lower triangle
  AlignedArray factor;      ///< its Cholesky factor, see Kernels::cholesky
  AlignedArray direction;
  Profile* profile = nullptr;
  NewtonPolicy policy;
  std::optional<Eigen::PartialPivLU<Eigen::MatrixXd>> lu;  ///< only for problems with a gyroscopic() part
};

/// True if the factor at hand brings the residual to its limit for less than a new Hessian costs.
inline bool factor_serves(const NewtonSettings& settings, double before, double now, double limit) {
  const double rate = now / before;
  return rate <= settings.chord_rate && std::log(now / limit) <= -settings.chord_steps * std::log(rate);
}

/// Adds that share of the largest diagonal entry to all of the diagonal.
inline void shift_diagonal(double share, Eigen::MatrixXd& hessian) {
  hessian.diagonal().array() += share * hessian.diagonal().cwiseAbs().maxCoeff();
}

namespace detail {

inline constexpr int kShifts = 12;
inline constexpr double kFirstShift = 1e-6;  // of shift_diagonal(); ten times as much each time

/// A problem that keeps its Hessian itself.
template <class Problem>
inline constexpr bool kFactorises = requires(Problem& problem) {
  problem.factorise();
};

inline bool factorise(NewtonWorkspace& workspace, NewtonReport& report) {
  const Eigen::Index size = workspace.hessian.rows();
  const StageTimer timer(workspace.profile, Stage::kSolve, static_cast<double>(size * size * size) / 3);
  ++report.factorisations;
  return kernels().cholesky(workspace.hessian.data(), size, workspace.hessian.outerStride(), workspace.factor.data());
}

template <class Problem>
bool factorise(Problem& problem, NewtonWorkspace& workspace, NewtonReport& report) {
  if constexpr (kFactorises<Problem>) {
    ++report.factorisations;
    return problem.factorise();
  } else {
    return factorise(workspace, report);
  }
}

/// A Hessian that even projected tangents leave indefinite is shifted until it is not.
template <class Problem>
bool factorise_shifted(Problem& problem, NewtonWorkspace& workspace, NewtonReport& report) {
  if (factorise(problem, workspace, report)) return true;
  double share = kFirstShift;
  for (int attempt = 0; attempt < kShifts; ++attempt, share *= 10) {
    if constexpr (kFactorises<Problem>)
      problem.shift(share);
    else
      shift_diagonal(share, workspace.hessian);
    if (factorise(problem, workspace, report)) return true;
  }
  return false;
}

template <class Problem>
const Eigen::MatrixXd* gyroscopic_part(const Problem& problem) {
  if constexpr (requires { problem.gyroscopic(); })
    return problem.gyroscopic();
  else
    return nullptr;
}

/// H + G, G antisymmetric: whatever G is, the direction of a positive definite H is one of descent.
inline void factorise_gyroscopic(const Eigen::MatrixXd& gyroscopic, NewtonWorkspace& workspace) {
  const Eigen::Index size = workspace.hessian.rows();
  const StageTimer timer(workspace.profile, Stage::kSolve, 2 * static_cast<double>(size * size * size) / 3);
  workspace.hessian.triangularView<Eigen::StrictlyUpper>() = workspace.hessian.transpose();
  workspace.hessian += gyroscopic;
  workspace.lu->compute(workspace.hessian);
}

/// workspace.direction = -(H + G)^-1 gradient, by the LU factors or, where G is weak, as -H^-1 (gradient + G (-H^-1
/// (gradient + ...))), as many terms as the problem asks for; returns its slope.
template <class Problem>
double solve_direction(Problem& problem, NewtonWorkspace& workspace, bool gyroscopic) {
  const Eigen::Index size = workspace.gradient.size();
  const StageTimer timer(workspace.profile, Stage::kSolve, 2.0 * static_cast<double>(size * size));
  Eigen::Map<Eigen::VectorXd> direction(workspace.direction.data(), size);
  if (gyroscopic) {
    direction.noalias() = workspace.lu->solve(-workspace.gradient);
    return workspace.gradient.dot(direction);
  }
  const auto solve = [&] {
    if constexpr (kFactorises<Problem>)
      problem.solve(direction);
    else
      kernels().cholesky_solve(workspace.factor.data(), size, direction.data());
  };
  direction = -workspace.gradient;
  solve();
  if constexpr (requires { problem.gyroscopic_terms(); }) {
    for (int term = problem.gyroscopic_terms(); term > 0; --term) {
      workspace.trial = direction;
      direction = -workspace.gradient - problem.gyroscopic_product(workspace.trial);
      solve();
    }
    // A series cut short may ascend.
    if (workspace.gradient.dot(direction) >= 0) {
      direction = -workspace.gradient;
      solve();
    }
  }
  return workspace.gradient.dot(direction);
}

}  // namespace detail

/// Minimises a potential from `x` by Newton's method: exact Hessian and Cholesky, positive semi-definite element
/// tangents only where Cholesky fails, Armijo line search. An earlier factor serves for as long as it brings the
/// residual down fast. docs/step_in_detail.md, "Newton". Problem offers, for x of the workspace's size,
///   PotentialEvaluation evaluate(x, gradient, hessian)   at the first iterate, lower triangle
///   PotentialEvaluation evaluate(x, gradient)
///   PotentialValue value(x)
///   void hessian(x, Tangent, hessian)                    lower triangle; x of the last evaluate()
///   void accept(evaluation)                              x of the last evaluate(x, gradient) is the next iterate
///   const MatrixXd* gyroscopic()                         optional: antisymmetric part of the Jacobian of the gradient
///                                                        of forces without a potential, or null where it is weak
///   int gyroscopic_terms(); VectorXd gyroscopic_product(x)   optional: how often a weak one is applied, its product
///   bool factorise(); void shift(double share);          optional: of a problem that keeps its Hessian itself, the
///   void solve(Map<VectorXd>& x)                         matrix handed to it is empty then; false where it is not
///                                                        positive definite, shift() then adds that share of its
///                                                        diagonal. x from the right-hand side, which descends
///                                                        wherever that is minus the gradient
///   bool kSeeksLowest                                    optional constant: lengths are halved for as long as the
///                                                        potential falls, beyond the first that is low enough
/// A hessian() of projected tangents may change what the problem keeps frozen; the gradient is then evaluated anew.
/// On return the last evaluate() was at x. `begin`: with the Hessian of the first iterate, or with the factor that
/// stands in the workspace, of a problem much like this one.
template <class Problem>
NewtonReport newton_minimise(Problem& problem, const NewtonSettings& settings, Eigen::VectorXd& x,
                             NewtonWorkspace& workspace, NewtonBegin begin = NewtonBegin::kHessian) noexcept {
  NewtonReport report;
  auto& [gradient, trial, trial_gradient, hessian, factor, direction, profile, policy, lu] = workspace;
  const bool begins_with_factor = begin == NewtonBegin::kFactor;
  PotentialEvaluation here =
      begins_with_factor ? problem.evaluate(x, gradient) : problem.evaluate(x, gradient, hessian);
  if (begins_with_factor) problem.accept(here);
  enum class Hessian { kEvaluated, kFactorised, kStale };
  Hessian state = begins_with_factor ? Hessian::kFactorised : Hessian::kEvaluated;
  const auto finish = [&](NewtonStatus status) {
    report.status = status;
    report.force_scale = here.force_scale;
    return report;
  };
  bool gyroscopic = false;
  double unchecked_from =
      std::numeric_limits<double>::infinity();  // residual before a step that no line search checked
  report.residual = gradient.norm();
  for (;;) {
    if (std::isfinite(unchecked_from) && !(report.residual <= unchecked_from)) {
      x.swap(trial);
      here = problem.evaluate(x, gradient);
      report.residual = gradient.norm();
      return finish(NewtonStatus::kStagnated);
    }
    if (const auto reason = reason_to_end(report, settings, here, unchecked_from)) return finish(*reason);

    const bool fresh = state != Hessian::kFactorised;
    if (state == Hessian::kStale) problem.hessian(x, Tangent::kExact, hessian);
    if (fresh && !detail::factorise(problem, workspace, report)) {
      if (!policy.projection) return finish(NewtonStatus::kStagnated);
      ++report.projections;
      problem.hessian(x, Tangent::kPositiveSemidefinite, hessian);
      here = problem.evaluate(x, gradient);
      problem.accept(here);
      report.residual = gradient.norm();
      if (!detail::factorise_shifted(problem, workspace, report)) return finish(NewtonStatus::kNonFinite);
    }
    if (fresh) {
      const Eigen::MatrixXd* part = detail::gyroscopic_part(problem);
      gyroscopic = part != nullptr;
      if (gyroscopic) detail::factorise_gyroscopic(*part, workspace);
    }
    const double slope = detail::solve_direction(problem, workspace, gyroscopic);
    if (!std::isfinite(slope)) return finish(NewtonStatus::kNonFinite);
    const Eigen::Map<const Eigen::VectorXd> step(direction.data(), x.size());
    const SearchLine<Eigen::Map<const Eigen::VectorXd>> line{x, gradient, step, here.potential, slope};
    const bool below_rounding = line.below_rounding();
    unchecked_from = below_rounding ? report.residual : std::numeric_limits<double>::infinity();
    PotentialEvaluation there;
    if (below_rounding || !policy.line_search) {
      // The potential cannot tell the two points apart, yet the gradient can: go on for as long as it falls.
      trial = x + step;
      there = problem.evaluate(trial, trial_gradient);
    } else if (!search_line(problem, line, {trial, trial_gradient, there}, report.line_search_evaluations)) {
      here = problem.evaluate(x, gradient);
      if (fresh) return finish(NewtonStatus::kStagnated);
      state = Hessian::kStale;
      continue;
    }
    problem.accept(there);
    x.swap(trial);
    gradient.swap(trial_gradient);
    here = there;
    ++report.iterations;
    const double before = report.residual;
    report.residual = gradient.norm();
    const double next_limit = settings.tolerance * here.force_scale;
    state = factor_serves(settings, before, report.residual, next_limit) ? Hessian::kFactorised : Hessian::kStale;
  }
}

}  // namespace exmat::runtime
