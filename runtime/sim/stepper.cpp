#include "runtime/sim/stepper.h"

#include <cmath>

#include "runtime/sim/incremental_potential.h"

namespace exmat::runtime {
namespace {

bool acts(const ScriptedForce& force, double time) { return force.start <= time && time < force.end; }

void gather_external_force(const StepScene& scene, double midpoint, Eigen::VectorXd& external_force) {
  external_force = scene.gravity_force;
  for (const ScriptedForce& force : scene.forces)
    if (acts(force, midpoint)) external_force += force.force;
}

/// Whether this step has no smooth past: the first one, or one that a scripted force begins or ends with.
bool begins_anew(const StepScene& scene, const State& state, double midpoint) {
  if (state.step == 0) return true;
  for (const ScriptedForce& force : scene.forces)
    if (acts(force, midpoint) != acts(force, midpoint - scene.time_step)) return true;
  return false;
}

/// w(q) after the bias, into the workspace. method.md, section 5.
void evaluate_weights(const Model& model, const StepScene& scene, const Eigen::VectorXd& q, Workspace& workspace) {
  const StageTimer timer(workspace.profile, Stage::kWeights);
  model.examples->weights.solve(q, workspace.weights_solver, workspace.weights);
  apply_example_bias(scene.examples->bias, workspace.weights);
}

/// Weights and target at the pose q, into the workspace. method.md, section 5.
void update_target(const Model& model, const StepScene& scene, const State& state, const Eigen::VectorXd& q,
                   Workspace& workspace, StepReport& report) {
  const ExampleModel& examples = *model.examples;
  evaluate_weights(model, scene, q, workspace);
  const StageTimer timer(workspace.profile, Stage::kTarget);
  workspace.target = state.target;
  if (!state.has_target) {
    examples.target.start(workspace.weights, workspace.target);
  } else if (workspace.weights == state.weights) {
    return;
  }
  const NewtonReport solved = examples.target.solve(workspace.weights, workspace.target_solver, workspace.target);
  report.target_iterations += solved.iterations;
  if (solved.status == NewtonStatus::kNonFinite) report.status |= kStepNonFinite;
  if (solved.status == NewtonStatus::kIterationLimit) report.status |= kTargetNotConverged;
}

/// f_example = -kappa (P_s q - p*) - c_kappa P_s qdot added to `force`.
void add_example_force(const Model& model, const StepScene& scene, const State& state, Workspace& workspace,
                       Eigen::VectorXd& force) {
  const ExampleModel& examples = *model.examples;
  workspace.offset = scene.examples->stiffness * state.q + scene.examples->damping * state.v;
  force.noalias() -= examples.filter.matrix() * workspace.offset;
  force.noalias() += scene.examples->stiffness * (examples.target.basis() * workspace.target);
}

/// a_n of Newmark's method from the equation of motion at the beginning of the step.
void start_acceleration(const Model& model, const StepScene& scene, const State& state, Workspace& workspace,
                        StepReport& report) {
  Eigen::VectorXd& a = workspace.acceleration;
  if (scene.stiffness_damping > 0) {
    Eigen::MatrixXd& stiffness = workspace.newton.hessian;
    model.elasticity.force_and_stiffness(state.q, workspace.elasticity, workspace.internal_force, stiffness);
    workspace.product.noalias() = stiffness.selfadjointView<Eigen::Lower>() * state.v;
    a = workspace.external_force - workspace.internal_force - scene.stiffness_damping * workspace.product;
  } else {
    model.elasticity.force(state.q, workspace.elasticity, workspace.internal_force);
    a = workspace.external_force - workspace.internal_force;
  }
  a -= scene.mass_damping * state.v;
  if (!runs_examples(model, scene)) return;
  update_target(model, scene, state, state.q, workspace, report);
  add_example_force(model, scene, state, workspace, a);
}

void prepare_integrator(const Model& model, const StepScene& scene, const State& state, bool anew, Workspace& workspace,
                        StepReport& report) {
  if (scene.integrator == Integrator::kNewmark) {
    if (anew) {
      start_acceleration(model, scene, state, workspace, report);
    } else {
      workspace.acceleration = state.a;
    }
    newmark_form(state, workspace.acceleration, scene.time_step, workspace.form);
  } else if (scene.integrator == Integrator::kBdf2 && !anew) {
    bdf2_form(state, scene.time_step, workspace.form);
  } else {
    backward_euler_form(state, scene.time_step, workspace.form);
  }
}

/// The predictor q_n + dt v_n or q_n itself, whichever has the lower potential, into workspace.q.
void choose_first_iterate(const Model& model, const StepScene& scene, const State& state,
                          const IncrementalPotential& potential, Workspace& workspace, StepReport& report) {
  const StageTimer timer(workspace.profile, Stage::kLineSearch);
  workspace.q = state.q;
  workspace.predictor = state.q + scene.time_step * state.v;
  if (workspace.predictor == state.q) return;
  const double predicted_energy = model.elasticity.energy(workspace.predictor, workspace.elasticity);
  ++report.line_search_evaluations;
  if (potential.without_damping(workspace.predictor, predicted_energy) <
      potential.without_damping(state.q, state.elastic_energy))
    workspace.q = workspace.predictor;
}

/// The terms of the example force that stay the same during the step.
void prepare_example_force(const Model& model, const StepScene& scene, Workspace& workspace) {
  const ExampleSettings& settings = *scene.examples;
  ExampleForce& force = workspace.example_force;
  const double damping = settings.damping * workspace.form.velocity_factor;
  force.stiffness = settings.stiffness + damping;
  force.centre = damping / force.stiffness * workspace.form.velocity_centre;
  force.pull.noalias() = settings.stiffness * (model.examples->target.basis() * workspace.target);
}

void commit(const Model& model, const StepScene& scene, double elastic_energy, Workspace& workspace, State& state) {
  const StepForm& form = workspace.form;
  state.q_previous = state.q;
  state.v_previous = state.v;
  state.q = workspace.q;
  state.v = workspace.product;
  state.a = form.acceleration_factor * (state.q - form.acceleration_centre);
  state.elastic_energy = elastic_energy;
  ++state.step;
  state.time = static_cast<double>(state.step) * scene.time_step;
  if (!runs_examples(model, scene)) return;
  state.weights = workspace.weights;
  state.target = workspace.target;
  state.has_target = true;
}

void add_newton_report(const NewtonReport& newton, StepReport& report) {
  report.newton_iterations = newton.iterations;
  report.line_search_evaluations += newton.line_search_evaluations;
  report.projections = newton.projections;
  report.residual = newton.residual;
  if (newton.status == NewtonStatus::kNonFinite) report.status |= kStepNonFinite;
  if (newton.status == NewtonStatus::kIterationLimit) report.status |= kStepIterationLimit;
  if (newton.status == NewtonStatus::kStagnated) report.status |= kStepStagnated;
}

}  // namespace

StepReport step(const Model& model, const StepScene& scene, State& state, Workspace& workspace) noexcept {
  StepReport report;
  const double midpoint = state.time + 0.5 * scene.time_step;
  gather_external_force(scene, midpoint, workspace.external_force);
  prepare_integrator(model, scene, state, begins_anew(scene, state, midpoint), workspace, report);

  IncrementalPotential potential(model, scene, workspace);
  choose_first_iterate(model, scene, state, potential, workspace, report);
  if (!workspace.q.allFinite()) report.status |= kStepNonFinite;
  if (runs_examples(model, scene) && !(report.status & kStepNonFinite)) {
    update_target(model, scene, state, workspace.q, workspace, report);
    prepare_example_force(model, scene, workspace);
  }
  if (report.status & kStepNonFinite) return report;

  workspace.newton.profile = workspace.profile;
  add_newton_report(newton_minimize(potential, scene.newton, workspace.q, workspace.newton), report);
  workspace.product = workspace.form.velocity_factor * (workspace.q - workspace.form.velocity_centre);
  if (!workspace.q.allFinite() || !workspace.product.allFinite()) report.status |= kStepNonFinite;
  if (!(report.status & kStepNonFinite)) commit(model, scene, potential.elastic_energy(), workspace, state);
  return report;
}

void refresh_weights(const Model& model, const StepScene& scene, State& state, Workspace& workspace) noexcept {
  if (!runs_examples(model, scene)) return;
  evaluate_weights(model, scene, state.q, workspace);
  state.weights = workspace.weights;
}

Energies energies(const StepScene& scene, const State& state) noexcept {
  return {0.5 * state.v.squaredNorm(), state.elastic_energy, -scene.gravity_force.dot(state.q)};
}

}  // namespace exmat::runtime
