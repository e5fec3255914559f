#include "tests/support/sparse_space/sparse_newton.h"

#include <limits>

namespace exmat::precompute {
namespace {

using runtime::NewtonReport;
using runtime::NewtonStatus;
using runtime::PotentialEvaluation;
using runtime::Tangent;

constexpr double kInfinity = std::numeric_limits<double>::infinity();

class Minimisation {
 public:
  Minimisation(StepPotential& potential, const runtime::NewtonSettings& settings, SparseDirection& solver,
               Eigen::VectorXd& d)
      : potential_(potential), settings_(settings), solver_(solver), d_(d) {}

  NewtonReport run();

 private:
  bool finished();
  bool find_direction();
  bool move();

  StepPotential& potential_;
  const runtime::NewtonSettings& settings_;
  SparseDirection& solver_;
  Eigen::VectorXd& d_;
  NewtonReport report_;
  PotentialEvaluation here_;
  Eigen::VectorXd gradient_, direction_;
  double unchecked_from_ = kInfinity;  // residual before a step that no line search checked
};

bool Minimisation::finished() {
  const auto reason = runtime::reason_to_end(report_, settings_, here_, unchecked_from_);
  if (reason) report_.status = *reason;
  return reason.has_value();
}

bool Minimisation::find_direction() {
  const auto product = [this](const Eigen::VectorXd& x) { return potential_.product(x); };
  potential_.assemble(d_, Tangent::kExact);
  if (solver_.solve(potential_.hessian(), product, -gradient_, direction_)) return true;
  ++report_.projections;
  potential_.assemble(d_, Tangent::kPositiveSemidefinite);
  here_ = potential_.evaluate(d_, gradient_);
  potential_.accept();
  report_.residual = gradient_.norm();
  return solver_.solve_shifted(potential_.hessian(), product, -gradient_, direction_);
}

// Along the direction; false where nothing lowers the potential.
bool Minimisation::move() {
  const runtime::SearchLine<Eigen::VectorXd> line{d_, gradient_, direction_, here_.potential,
                                                  gradient_.dot(direction_)};
  const bool below_rounding = line.below_rounding();
  unchecked_from_ = below_rounding ? report_.residual : kInfinity;
  Eigen::VectorXd trial, trial_gradient;
  PotentialEvaluation there;
  if (below_rounding) {
    // The potential cannot tell the two points apart, yet the gradient can: go on for as long as it falls.
    trial = d_ + direction_;
    there = potential_.evaluate(trial, trial_gradient);
    if (!(trial_gradient.norm() <= report_.residual)) {
      here_ = potential_.evaluate(d_, gradient_);
      return false;
    }
  } else if (!runtime::search_line(potential_, line, {trial, trial_gradient, there}, report_.line_search_evaluations)) {
    here_ = potential_.evaluate(d_, gradient_);
    return false;
  }
  potential_.accept();
  d_.swap(trial);
  gradient_.swap(trial_gradient);
  here_ = there;
  ++report_.iterations;
  report_.residual = gradient_.norm();
  return true;
}

NewtonReport Minimisation::run() {
  here_ = potential_.evaluate_first(d_, gradient_);
  report_.residual = gradient_.norm();
  const int before = solver_.factorisations();
  while (!finished()) {
    if (!find_direction() || !direction_.allFinite()) {
      report_.status = NewtonStatus::kNonFinite;
      break;
    }
    if (move()) continue;
    report_.status = NewtonStatus::kStagnated;
    break;
  }
  report_.factorisations = solver_.factorisations() - before;
  return report_;
}

}  // namespace

NewtonReport minimise_step(StepPotential& potential, const runtime::NewtonSettings& settings, SparseDirection& solver,
                           Eigen::VectorXd& d) {
  return Minimisation(potential, settings, solver, d).run();
}

}  // namespace exmat::precompute
