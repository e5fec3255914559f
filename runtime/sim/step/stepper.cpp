#include "runtime/sim/step/stepper.h"

#include <algorithm>
#include <cmath>

#include "runtime/sim/step/contact_step.h"
#include "runtime/sim/step/example_forces.h"
#include "runtime/sim/step/incremental_potential.h"

namespace exmat::runtime {
namespace {

constexpr double kResolvedTurn = 0.3;  // [rad] of a free body in one step
FrameStep frame_step(const StepScene& scene, const State& state) {
  const double end = static_cast<double>(state.step + 1) * scene.time_step;
  return {scene, scene.time_step, state.time, end, state.q, state.v, state.applied_force};
}

StepHistory history_of(const Model& model, const State& state) {
  return {state.q, state.v, state.q_previous, model.frame->momentum(state.v, state.frame),
          model.frame->former_momentum(state.v_previous, state.frame)};
}

/// What resolves a step: backward Euler where a body that is not clamped in the world turns too far in it for anything
/// of second order.
Integrator integrator_of_step(const Model& model, const StepScene& scene, const State& state, bool near) {
  const bool resolved = !near && model.frame->turn_rate(state.frame) * scene.time_step <= kResolvedTurn;
  return resolved ? scene.integrator : Integrator::kBackwardEuler;
}

/// Whether this step has no smooth past: the first one, or one that a scripted force begins or ends with, or in which
/// the accelerations of the frame jump.
bool begins_anew(const Model& model, const StepScene& scene, const State& state, double midpoint) {
  if (state.begins_anew) return true;
  for (const ScriptedForce& force : scene.forces)
    if (force.acts_at(midpoint) != force.acts_at(midpoint - scene.time_step)) return true;
  return model.frame->jumps(scene, midpoint - scene.time_step, midpoint);
}

/// a_n of Newmark's method from the equation of motion at the beginning of the step.
void start_acceleration(const Model& model, const StepScene& scene, const FrameStep& frame_step, const State& state,
                        Workspace& workspace, StepReport& report) {
  model.frame->enter_start(frame_step, workspace.frame, workspace.external_force);
  Eigen::VectorXd& a = workspace.acceleration;
  if (scene.stiffness_damping > 0) {
    Eigen::MatrixXd& stiffness = workspace.newton.hessian;
    model.internal_force.force_and_stiffness(state.q, workspace.elasticity, workspace.internal_force, stiffness);
    workspace.offset.noalias() = stiffness.selfadjointView<Eigen::Lower>() * state.v;
    a = workspace.external_force - workspace.internal_force - scene.stiffness_damping * workspace.offset;
  } else {
    model.internal_force.force(state.q, workspace.elasticity, workspace.internal_force);
    a = workspace.external_force - workspace.internal_force;
  }
  a -= scene.mass_damping * state.v;
  model.frame->add_start_force(frame_step, state.frame, workspace.frame, a);
  model.frame->leave_start(frame_step, workspace.frame, workspace.external_force);
  if (!runs_examples(scene)) return;
  update_targets(model, scene, state, state.q, workspace, report);
  add_example_forces(model, scene, state, workspace, a);
}

void prepare_integrator(const Model& model, const StepScene& scene, const FrameStep& frame_step, Integrator integrator,
                        const State& state, Workspace& workspace, StepReport& report) {
  const bool anew = begins_anew(model, scene, state, frame_step.midpoint());
  const StepHistory history = history_of(model, state);
  if (integrator == Integrator::kNewmark) {
    if (anew) {
      start_acceleration(model, scene, frame_step, state, workspace, report);
    } else {
      workspace.acceleration = state.a;
    }
    newmark_form(history, workspace.acceleration, scene.time_step, workspace.form);
  } else if (integrator == Integrator::kBdf2 && !anew) {
    bdf2_form(history, scene.time_step, workspace.form);
  } else {
    backward_euler_form(history, scene.time_step, workspace.form);
  }
}

/// The predictor q_n + dt v_n or q_n itself, whichever has the lower potential, into workspace.q, and its elasticity.
void choose_first_iterate(const StepScene& scene, const State& state, IncrementalPotential& potential,
                          Workspace& workspace, StepReport& report) {
  workspace.q = state.q + scene.time_step * state.v;
  const double predicted = potential.start(workspace.q);
  if (predicted <= potential.potential_at_start() || workspace.q == state.q) return;
  ++report.line_search_evaluations;
  workspace.q = state.q;
  potential.start(workspace.q);
}

/// Arithmetic on subnormal numbers takes a hundred times as long, and a body that comes to rest is full of them.
bool flush_subnormals(Eigen::VectorXd& numbers) {
  bool found = false;
  for (double& number : numbers)
    if (std::fpclassify(number) == FP_SUBNORMAL) {
      number = 0;
      found = true;
    }
  return found;
}

void commit(const Model& model, const StepScene& scene, double elastic_energy, Workspace& workspace, State& state) {
  const StepForm& form = workspace.form;
  state.q_previous = state.q;
  state.v_previous = state.v;
  state.q = workspace.q;
  state.v = workspace.v;
  state.a = form.acceleration_factor * (state.q - form.acceleration_centre);
  model.frame->commit(scene, form.velocity_factor, state.q, state.v, state.a, workspace.frame, state.frame);
  state.elastic_energy = elastic_energy;
  ++state.step;
  state.time = static_cast<double>(state.step) * scene.time_step;
  commit_weights(scene, workspace, state);
  commit_targets(model, scene, workspace, state);
}

/// A step near obstacles that did not converge may leave contact forces that throw the body: it is slowed down until it
/// has no more energy than before, or stands still. The force of the contacts tells the difference.
void take_back_energy(const Model& model, const StepScene& scene, const Energies& before, Workspace& workspace,
                      State& state, StepReport& report) {
  const Energies now = energies(model, scene, state);
  const double allowed = std::max(0.0, before.total() - now.elastic - now.potential);
  if (model.frame->is_driven() || now.kinetic <= allowed) return;
  const Eigen::Vector3d impulse = scene.time_step * report.contact_force;
  const Eigen::Vector3d lost =
      model.frame->limit_kinetic_energy(allowed, impulse, workspace.frame, state.v, state.frame);
  report.contact_force -= lost / scene.time_step;
}

void add_newton_report(const NewtonReport& newton, StepReport& report) {
  report.newton_iterations = newton.iterations;
  report.line_search_evaluations += newton.line_search_evaluations;
  report.factorisations = newton.factorisations;
  report.projections = newton.projections;
  report.residual = newton.residual;
  if (newton.status == NewtonStatus::kNonFinite) report.status |= kStepNonFinite;
  if (newton.status == NewtonStatus::kIterationLimit) report.status |= kStepIterationLimit;
  if (newton.status == NewtonStatus::kStagnated) report.status |= kStepStagnated;
}

/// Stages 3 to 6 of the step, its form and external forces given: q at its end into the workspace, and the elastic
/// energy there.
NewtonReport solve(const Model& model, const StepScene& scene, const State& state, bool near, Workspace& workspace,
                   StepReport& report, double& elastic_energy) {
  NewtonReport failed;
  failed.status = NewtonStatus::kNonFinite;
  IncrementalPotential potential(model, scene, state, workspace);
  choose_first_iterate(scene, state, potential, workspace, report);
  if (!workspace.q.allFinite()) return failed;
  if (runs_examples(scene)) {
    update_targets(model, scene, state, workspace.q, workspace, report);
    if (report.status & kStepNonFinite) return failed;
    prepare_example_forces(scene, workspace);
  }
  potential.prepare();
  const NewtonReport newton = near ? solve_with_contacts(model, scene, state, potential, workspace)
                                   : newton_minimise(potential, scene.newton, workspace.q, workspace.newton);
  elastic_energy = potential.elastic_energy();
  return newton;
}

}  // namespace

StepReport step(const Model& model, const StepScene& scene, State& state, Workspace& workspace) noexcept {
  StepReport report;
  const BodyFrame& frame = *model.frame;
  const FrameStep in_frame = frame_step(scene, state);
  frame.begin(in_frame, workspace.frame, workspace.external_force);
  const bool near = is_near_obstacles(model, scene, state, workspace);
  const Integrator integrator = integrator_of_step(model, scene, state, near);
  frame.move(in_frame, near, integrator == Integrator::kBackwardEuler, state.frame, workspace.frame,
             workspace.external_force);
  prepare_integrator(model, scene, in_frame, integrator, state, workspace, report);

  workspace.newton.profile = workspace.profile;
  double elastic_energy = 0;
  NewtonReport newton = solve(model, scene, state, near, workspace, report, elastic_energy);
  if (newton.status == NewtonStatus::kNonFinite && !near && frame.fall_back(in_frame, workspace.frame)) {
    backward_euler_form(history_of(model, state), scene.time_step, workspace.form);
    newton = solve(model, scene, state, near, workspace, report, elastic_energy);
  }
  add_newton_report(newton, report);
  workspace.v = workspace.form.velocity_factor * (workspace.q - workspace.form.velocity_centre);
  if (!workspace.q.allFinite() || !workspace.v.allFinite()) report.status |= kStepNonFinite;
  if (report.status & kStepNonFinite) return report;
  if (near) {
    report.contacts = workspace.near->contact.touching;
    report.contact_force = workspace.near->contact.force;
  }
  const bool small_q = flush_subnormals(workspace.q), small_v = flush_subnormals(workspace.v);
  if (small_q || small_v) report.status |= kStepSubnormal;
  const bool unbalanced = near && newton.status != NewtonStatus::kConverged;
  const Energies before = unbalanced ? energies(model, scene, state) : Energies{};
  commit(model, scene, elastic_energy, workspace, state);
  if (unbalanced) take_back_energy(model, scene, before, workspace, state, report);
  state.begins_anew = near;
  commit_contacts(model, near, workspace, state);
  return report;
}

void refresh_weights(const Model& model, const StepScene& scene, State& state, Workspace& workspace) noexcept {
  evaluate_weights(model, scene, state.q, workspace);
  commit_weights(scene, workspace, state);
}

bool move_body(const Model& model, const StepScene& scene, const FrameMotion& motion, State& state,
               Workspace& workspace) noexcept {
  const Placement before = model.frame->placement(state.frame);
  if (!model.frame->set_motion(motion, state.q, state.v, workspace.frame, state.frame)) return false;
  carry_contacts(scene, before, model.frame->placement(state.frame), state);
  state.begins_anew = true;
  return true;
}

void follow_frame(const Model& model, const StepScene& scene, State& state, Workspace& workspace) noexcept {
  model.frame->follow(scene, state.time, state.q, state.v, workspace.frame, state.frame);
}

Energies energies(const Model& model, const StepScene& scene, const State& state) noexcept {
  return {model.frame->kinetic_energy(state.v, state.frame), state.elastic_energy,
          -scene.gravity_force.dot(state.q) + model.frame->potential_energy(scene.gravity, state.frame)};
}

}  // namespace exmat::runtime
