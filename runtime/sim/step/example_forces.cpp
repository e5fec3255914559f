#include "runtime/sim/step/example_forces.h"

namespace exmat::runtime {
namespace {

/// The pull of p*, p* by Newton's method from the last target, into the workspace.
void solve_target(const ExampleModel& model, int most_iterations, const ExampleState& state,
                  ExampleWorkspace& workspace, StepReport& report) noexcept {
  const TargetSolver& solver = *model.target;
  Eigen::VectorXd& y = workspace.solved_target;
  y = state.target;
  if (!state.has_target) solver.start(workspace.weights, y);
  workspace.target_converged = state.has_target && state.target_converged && workspace.weights == state.weights;
  if (!workspace.target_converged) {
    const NewtonReport solved = solver.solve(workspace.weights, workspace.target_solver, y, most_iterations);
    report.target_iterations += solved.iterations;
    workspace.target_converged = solved.status != NewtonStatus::kIterationLimit;
    if (!workspace.target_converged) report.status |= kTargetNotConverged;
    if (solved.status == NewtonStatus::kNonFinite) report.status |= kStepNonFinite;
  }
  workspace.target.noalias() = model.target_pull * y;
}

}  // namespace

void evaluate_weights(const Model& model, const StepScene& scene, const Eigen::VectorXd& q,
                      Workspace& workspace) noexcept {
  const StageTimer timer(workspace.profile, Stage::kWeights);
  for (std::size_t i = 0; i < scene.examples.size(); ++i) {
    if (!acts(scene.examples[i])) continue;
    ExampleWorkspace& scratch = workspace.examples[i];
    model.examples[i].weights.solve(q, scratch.weights_solver, scratch.weights);
    apply_example_bias(scene.examples[i].bias, scratch.weights);
  }
}

void update_targets(const Model& model, const StepScene& scene, const State& state, const Eigen::VectorXd& q,
                    Workspace& workspace, StepReport& report) noexcept {
  evaluate_weights(model, scene, q, workspace);
  const StageTimer timer(workspace.profile, Stage::kTarget);
  for (std::size_t i = 0; i < scene.examples.size(); ++i) {
    const ExampleSettings& settings = scene.examples[i];
    const ExampleModel& examples = model.examples[i];
    ExampleWorkspace& scratch = workspace.examples[i];
    if (!acts(settings)) continue;
    if (examples.table)
      examples.table->evaluate(scratch.weights, scratch.target_table, scratch.target);
    else
      solve_target(examples, settings.target_iterations, state.examples[i], scratch, report);
  }
}

void prepare_example_forces(const StepScene& scene, Workspace& workspace) noexcept {
  for (std::size_t i = 0; i < scene.examples.size(); ++i) {
    const ExampleSettings& settings = scene.examples[i];
    if (!acts(settings)) continue;
    ExampleForce& force = workspace.examples[i].force;
    const double damping = settings.damping * workspace.form.velocity_factor;
    force.stiffness = settings.stiffness + damping;
    force.centre = damping / force.stiffness * workspace.form.velocity_centre;
    force.pull = settings.stiffness * workspace.examples[i].target;
  }
}

void add_example_forces(const Model& model, const StepScene& scene, const State& state, Workspace& workspace,
                        Eigen::VectorXd& force) noexcept {
  for (std::size_t i = 0; i < scene.examples.size(); ++i) {
    const ExampleSettings& settings = scene.examples[i];
    if (!acts(settings)) continue;
    workspace.offset = settings.stiffness * state.q + settings.damping * state.v;
    force.noalias() -= model.examples[i].filter.matrix() * workspace.offset;
    force += settings.stiffness * workspace.examples[i].target;
  }
}

void commit_weights(const StepScene& scene, const Workspace& workspace, State& state) noexcept {
  for (std::size_t i = 0; i < scene.examples.size(); ++i)
    if (acts(scene.examples[i])) state.examples[i].weights = workspace.examples[i].weights;
}

void commit_targets(const Model& model, const StepScene& scene, const Workspace& workspace, State& state) noexcept {
  for (std::size_t i = 0; i < scene.examples.size(); ++i) {
    if (!acts(scene.examples[i]) || model.examples[i].table) continue;
    ExampleState& examples = state.examples[i];
    examples.target = workspace.examples[i].solved_target;
    examples.has_target = true;
    examples.target_converged = workspace.examples[i].target_converged;
  }
}

}  // namespace exmat::runtime
