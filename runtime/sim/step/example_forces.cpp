#include "runtime/sim/step/example_forces.h"

namespace exmat::runtime {

void find_target(const ExampleModel& model, const ExampleSettings& settings, const ExampleState& state,
                 ExampleWorkspace& workspace, StepReport& report) noexcept {
  const bool elastic = settings.elastic;
  if (model.table)
    model.table->evaluate(workspace.weights, workspace.target_table,
                          elastic ? workspace.solved_target : workspace.target);
  else
    solve_target(model, settings.target_iterations, state, workspace, report);
  if (elastic)
    model.elasticity->set_target(workspace.solved_target, settings.stiffness, *workspace.elasticity);
  else if (!model.table)
    workspace.target.noalias() = model.target_pull * workspace.solved_target;
}

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
}

void set_weights(const ExampleWeights& weights, const ExampleSettings& settings, const Eigen::VectorXd& coordinates,
                 ExampleWorkspace& workspace) noexcept {
  if (settings.given_weights.size() > 0) {
    workspace.weights = settings.given_weights;
    return;
  }
  weights.solve(coordinates, workspace.weights_solver, workspace.weights);
  apply_example_bias(settings.bias, workspace.weights);
}

void evaluate_weights(const Model& model, const StepScene& scene, const Eigen::VectorXd& q,
                      Workspace& workspace) noexcept {
  const StageTimer timer(workspace.profile, Stage::kWeights);
  for (std::size_t i = 0; i < scene.examples.size(); ++i) {
    if (acts(scene.examples[i])) set_weights(model.examples[i].weights, scene.examples[i], q, workspace.examples[i]);
  }
}

void update_targets(const Model& model, const StepScene& scene, const State& state, const Eigen::VectorXd& q,
                    Workspace& workspace, StepReport& report) noexcept {
  evaluate_weights(model, scene, q, workspace);
  const StageTimer timer(workspace.profile, Stage::kTarget);
  for (std::size_t i = 0; i < scene.examples.size(); ++i) {
    if (acts(scene.examples[i]))
      find_target(model.examples[i], scene.examples[i], state.examples[i], workspace.examples[i], report);
  }
}

void prepare_example_forces(const StepScene& scene, Workspace& workspace) noexcept {
  for (std::size_t i = 0; i < scene.examples.size(); ++i) {
    const ExampleSettings& settings = scene.examples[i];
    if (!is_filtered(settings)) continue;
    ExampleForce& force = workspace.examples[i].force;
    const double damping = settings.damping * workspace.form.velocity_factor;
    force.stiffness = linear_stiffness(settings) + damping;
    force.centre = damping / force.stiffness * workspace.form.velocity_centre;
    force.pull = linear_stiffness(settings) * workspace.examples[i].target;
  }
}

void add_example_forces(const Model& model, const StepScene& scene, const State& state, Workspace& workspace,
                        Eigen::VectorXd& force) noexcept {
  for (std::size_t i = 0; i < scene.examples.size(); ++i) {
    const ExampleSettings& settings = scene.examples[i];
    if (!is_filtered(settings)) continue;
    workspace.offset = linear_stiffness(settings) * state.q + settings.damping * state.v;
    force.noalias() -= model.examples[i].filter * workspace.offset;
    force += linear_stiffness(settings) * workspace.examples[i].target;
  }
  workspace.offset.setZero();
  add_elastic_example_forces(model, scene, state.q, workspace, workspace.offset);
  force -= workspace.offset;
}

double elastic_example_energy(const Model& model, const StepScene& scene, const Eigen::VectorXd& q,
                              const Workspace& workspace) noexcept {
  double energy = 0;
  for (std::size_t i = 0; i < scene.examples.size(); ++i)
    if (elastic_factor(scene.examples[i]) > 0)
      energy += model.examples[i].elasticity->energy(q, *workspace.examples[i].elasticity);
  return energy;
}

double add_elastic_example_forces(const Model& model, const StepScene& scene, const Eigen::VectorXd& q,
                                  Workspace& workspace, Eigen::VectorXd& gradient) noexcept {
  double energy = 0;
  for (std::size_t i = 0; i < scene.examples.size(); ++i)
    if (elastic_factor(scene.examples[i]) > 0)
      energy += model.examples[i].elasticity->add_force(q, *workspace.examples[i].elasticity, gradient);
  return energy;
}

void add_elastic_example_stiffness(const Model& model, const StepScene& scene, const Eigen::VectorXd& q,
                                   Tangent tangent, Workspace& workspace, Eigen::MatrixXd& hessian) noexcept {
  for (std::size_t i = 0; i < scene.examples.size(); ++i)
    if (elastic_factor(scene.examples[i]) > 0)
      model.examples[i].elasticity->add_stiffness(q, tangent, *workspace.examples[i].elasticity, hessian);
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
