#include "precompute/full_space/target_update.h"

namespace exmat::precompute {
namespace {

using runtime::ExampleState;
using runtime::NewtonReport;
using runtime::NewtonStatus;

// The blend of the examples.
Eigen::VectorXd start_target(const FullSpaceModel& model, std::size_t group, const Eigen::VectorXd& weights) {
  const FullSpaceExamples& examples = model.examples[group];
  Eigen::VectorXd target = Eigen::VectorXd::Zero(examples.pose_basis().cols());
  if (model.target_methods.empty()) {
    examples.target().start(weights, target);
    return target;
  }
  for (Eigen::Index k = 0; k < examples.count(); ++k) target += weights[k] * examples.pose(k);
  return target;
}

void solve_target(const FullSpaceModel& model, std::size_t group,
                  std::optional<runtime::TargetSolver::Workspace>& scratch, ExampleState& examples,
                  FullSpaceReport& report) {
  const runtime::TargetSolver& solver = model.examples[group].target();
  if (!scratch) scratch.emplace(solver.make_workspace());
  const NewtonReport solved = solver.solve(examples.weights, *scratch, examples.target);
  report.target_iterations += solved.iterations;
  examples.target_converged = solved.status != NewtonStatus::kIterationLimit;
  if (solved.status == NewtonStatus::kNonFinite) report.status |= runtime::kStepNonFinite;
}

void solve_by_method(const TargetMethod& method, ExampleState& examples, FullSpaceReport& report) {
  const TargetMethod::Solved solved = method.solve(examples.weights, examples.target);
  report.target_iterations += solved.iterations;
  examples.target_converged = solved.converged;
  if (!examples.target.allFinite()) report.status |= runtime::kStepNonFinite;
}

}  // namespace

ExampleState next_target(const FullSpaceModel& model, std::size_t group, const runtime::ExampleSettings& settings,
                         const ExampleState& former, const Eigen::VectorXd& u,
                         std::optional<runtime::TargetSolver::Workspace>& scratch, FullSpaceReport& report) {
  ExampleState next = former;
  if (settings.given_weights.size() > 0) {
    next.weights = settings.given_weights;
  } else {
    next.weights = model.examples[group].weights(u);
    runtime::apply_example_bias(settings.bias, next.weights);
  }
  if (!former.has_target) next.target = start_target(model, group, next.weights);
  next.has_target = true;
  next.target_converged = former.has_target && former.target_converged && next.weights == former.weights;
  if (!next.target_converged) {
    if (model.target_methods.empty())
      solve_target(model, group, scratch, next, report);
    else
      solve_by_method(*model.target_methods[group], next, report);
  }
  if (!next.target_converged) report.status |= runtime::kTargetNotConverged;
  return next;
}

Eigen::VectorXd target_displacement(const FullSpaceModel& model, std::size_t group, const ExampleState& state) {
  const FullSpaceExamples& examples = model.examples[group];
  return (model.target_methods.empty() ? examples.target_fields() : examples.pose_basis()) * state.target;
}

}  // namespace exmat::precompute
