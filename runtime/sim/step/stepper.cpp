#include "runtime/sim/step/stepper.h"

#include <algorithm>
#include <cmath>

#include "runtime/sim/step/contact_step.h"
#include "runtime/sim/step/example_forces.h"
#include "runtime/sim/step/incremental_potential.h"

namespace exmat::runtime {
namespace {

constexpr double kResolvedTurn = 0.3;  // [rad] of a free body in one step
constexpr double kBesideKey = 1e-6;    // of a step

bool acts_at(const ScriptedForce& force, double time) { return force.start <= time && time < force.end; }

/// Of a free body only what the caller applies; the rest acts on its momenta first.
void gather_external_force(const Model& model, const StepScene& scene, const State& state, double midpoint,
                           Workspace& workspace) {
  Eigen::VectorXd& external_force = workspace.external_force;
  external_force = state.applied_force;
  if (!model.carried) external_force += scene.gravity_force;
  if (model.carried)
    add_carried_load(*model.carried, model.gravity_load, scene.gravity, *workspace.carried, external_force);
  if (state.body) return;
  for (const ScriptedForce& force : scene.forces) {
    if (!acts_at(force, midpoint)) continue;
    if (model.carried)
      external_force.noalias() +=
          force.mean_basis.transpose() * (workspace.carried->frame.rotation.transpose() * force.total);
    else
      external_force += force.force;
  }
}

/// The motion at `time`, with the accelerations `beside` [s] it: they may jump at keys, and a step has those within it.
MotionSample sample_beside(const RigidMotion& motion, double time, double beside) {
  MotionSample sample = motion.sample(time);
  const MotionSample within = motion.sample(time + beside);
  sample.linear_acceleration = within.linear_acceleration;
  sample.angular_acceleration = within.angular_acceleration;
  return sample;
}

/// The motion that carries a body at `frame`, and the external forces there, into the workspace.
void take_frame(const Model& model, const StepScene& scene, const State& state, const MotionSample& frame,
                double midpoint, Workspace& workspace) {
  set_frame(frame, *workspace.carried);
  gather_external_force(model, scene, state, midpoint, workspace);
}

/// Momenta and centre of mass of a free body at the end of the step, and its forces on q, into the workspace. Scripted
/// forces act where the body would be at the middle of the step by its spin. The centre of mass is exact for them, away
/// from obstacles.
void move_free_body(const Model& model, const StepScene& scene, Integrator integrator, bool near, const State& state,
                    double midpoint, Workspace& workspace) {
  FreeState& body = *workspace.body;
  body = *state.body;
  const double dt = scene.time_step;
  const Eigen::Matrix3d rotation = body.orientation.toRotationMatrix() * rotation_of(0.5 * dt * body.spin);
  Eigen::Vector3d force = model.rigid->mass() * scene.gravity + body.applied_force, torque = body.applied_torque;
  for (const ScriptedForce& scripted : scene.forces) {
    if (!acts_at(scripted, midpoint)) continue;
    const Eigen::Vector3d local = rotation.transpose() * scripted.total;
    const Eigen::Vector3d arm = scripted.lever + scripted.mean_basis * state.q;
    force += scripted.total;
    torque += rotation * arm.cross(local);
    workspace.external_force.noalias() += scripted.mean_basis.transpose() * local;
  }
  // Forces that contacts balance have to act on the position as those do.
  const double share = near ? 1 : 0.5;
  body.position += dt / model.rigid->mass() * (body.linear_momentum + share * dt * force);
  body.linear_momentum += dt * force;
  body.angular_momentum += dt * torque;
  begin_rotation(body, dt, integrator == Integrator::kBackwardEuler, *workspace.free);
}

/// What resolves a step: backward Euler where a body that is not clamped in the world turns too far in it for anything
/// of second order.
Integrator integrator_of_step(const StepScene& scene, const State& state, bool near) {
  double spin = state.body ? state.body->spin.norm() : 0;
  if (state.carried) spin = state.carried->frame.angular_velocity.norm();
  const bool resolved = !near && spin * scene.time_step <= kResolvedTurn;
  return resolved ? scene.integrator : Integrator::kBackwardEuler;
}

/// Whether this step has no smooth past: the first one, or one that a scripted force begins or ends with, or that a key
/// of the motion that carries the body lies at.
bool begins_anew(const StepScene& scene, const State& state, double midpoint) {
  if (state.begins_anew) return true;
  for (const ScriptedForce& force : scene.forces)
    if (acts_at(force, midpoint) != acts_at(force, midpoint - scene.time_step)) return true;
  return scene.carrier && scene.carrier->has_key(midpoint - scene.time_step, midpoint);
}

/// a_n of Newmark's method from the equation of motion at the beginning of the step.
void start_acceleration(const Model& model, const StepScene& scene, const State& state, Workspace& workspace,
                        StepReport& report) {
  const double midpoint = state.time + 0.5 * scene.time_step;
  const MotionSample end = model.carried ? workspace.carried->frame : MotionSample{};
  if (model.carried)
    take_frame(model, scene, state, sample_beside(*scene.carrier, state.time, kBesideKey * scene.time_step), midpoint,
               workspace);
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
  if (state.body) {
    FreeMotionWorkspace& free = *workspace.free;
    free.velocity = state.v;
    free.solution.spin = state.body->spin;
    model.rigid->moments(state.q, free.moments);
    rotation_force(*model.rigid, 0, free);
    a += free.force;
  }
  if (model.carried) {
    workspace.carried->velocity = state.v;
    carried_force(*model.carried, state.q, *workspace.carried);
    a += workspace.carried->force;
    take_frame(model, scene, state, end, midpoint, workspace);
  }
  if (!runs_examples(scene)) return;
  update_targets(model, scene, state, state.q, workspace, report);
  add_example_forces(model, scene, state, workspace, a);
}

void prepare_integrator(const Model& model, const StepScene& scene, Integrator integrator, const State& state,
                        bool anew, Workspace& workspace, StepReport& report) {
  if (integrator == Integrator::kNewmark) {
    if (anew) {
      start_acceleration(model, scene, state, workspace, report);
    } else {
      workspace.acceleration = state.a;
    }
    newmark_form(state, workspace.acceleration, scene.time_step, workspace.form);
  } else if (integrator == Integrator::kBdf2 && !anew) {
    bdf2_form(state, scene.time_step, workspace.form);
  } else {
    backward_euler_form(state, scene.time_step, workspace.form);
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
  state.v = workspace.offset;
  state.a = form.acceleration_factor * (state.q - form.acceleration_centre);
  if (state.body) commit_free_motion(workspace.form.velocity_factor, workspace.body.value(), *workspace.free, state);
  if (model.carried)
    state.carried =
        carried_state(*model.carried, model.gravity_load, scene.gravity, state.q, state.v, *workspace.carried);
  state.elastic_energy = elastic_energy;
  ++state.step;
  state.time = static_cast<double>(state.step) * scene.time_step;
  commit_weights(scene, workspace, state);
  commit_targets(model, scene, workspace, state);
}

/// A step near obstacles that did not converge may leave contact forces that throw the body: it is slowed down until it
/// has no more energy than before, or stands still. The force of the contacts tells the difference.
void take_back_energy(const StepScene& scene, const Energies& before, State& state, StepReport& report) {
  const Energies now = energies(scene, state);
  const double allowed = before.total() - now.elastic - now.potential;
  if (state.carried || now.kinetic <= allowed) return;
  const double share = std::sqrt(std::max(allowed, 0.0) / now.kinetic);
  state.v *= share;
  if (!state.body) return;
  FreeState& body = *state.body;
  report.contact_force -= (1 - share) / scene.time_step * body.linear_momentum;
  body.linear_momentum *= share;
  body.angular_momentum *= share;
  body.spin *= share;
  body.momentum *= share;
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
                                   : newton_minimize(potential, scene.newton, workspace.q, workspace.newton);
  elastic_energy = potential.elastic_energy();
  return newton;
}

}  // namespace

StepReport step(const Model& model, const StepScene& scene, State& state, Workspace& workspace) noexcept {
  StepReport report;
  const double midpoint = state.time + 0.5 * scene.time_step;
  const double end = static_cast<double>(state.step + 1) * scene.time_step;
  if (model.carried)
    take_frame(model, scene, state, sample_beside(*scene.carrier, end, -kBesideKey * scene.time_step), midpoint,
               workspace);
  else
    gather_external_force(model, scene, state, midpoint, workspace);
  const bool near = is_near_obstacles(model, scene, state, workspace);
  const Integrator integrator = integrator_of_step(scene, state, near);
  if (state.body) move_free_body(model, scene, integrator, near, state, midpoint, workspace);
  prepare_integrator(model, scene, integrator, state, begins_anew(scene, state, midpoint), workspace, report);

  workspace.newton.profile = workspace.profile;
  double elastic_energy = 0;
  NewtonReport newton = solve(model, scene, state, near, workspace, report, elastic_energy);
  if (newton.status == NewtonStatus::kNonFinite && state.body && !near) {
    backward_euler_form(state, scene.time_step, workspace.form);
    turn_rigidly(*model.rigid, state.q, state.v, scene.time_step, *workspace.free);
    newton = solve(model, scene, state, near, workspace, report, elastic_energy);
  }
  add_newton_report(newton, report);
  workspace.offset = workspace.form.velocity_factor * (workspace.q - workspace.form.velocity_centre);
  if (!workspace.q.allFinite() || !workspace.offset.allFinite()) report.status |= kStepNonFinite;
  if (report.status & kStepNonFinite) return report;
  if (near) {
    report.contacts = workspace.near->contact.touching;
    report.contact_force = workspace.near->contact.force;
  }
  const bool small_q = flush_subnormals(workspace.q), small_v = flush_subnormals(workspace.offset);
  if (small_q || small_v) report.status |= kStepSubnormal;
  const bool unbalanced = near && newton.status != NewtonStatus::kConverged;
  const Energies before = unbalanced ? energies(scene, state) : Energies{};
  commit(model, scene, elastic_energy, workspace, state);
  if (unbalanced) take_back_energy(scene, before, state, report);
  state.begins_anew = near;
  commit_contacts(model, near, workspace, state);
  return report;
}

void refresh_weights(const Model& model, const StepScene& scene, State& state, Workspace& workspace) noexcept {
  evaluate_weights(model, scene, state.q, workspace);
  commit_weights(scene, workspace, state);
}

void place_on_carrier(const Model& model, const StepScene& scene, State& state) {
  CarriedWorkspace workspace(*model.carried);
  set_frame(scene.carrier->sample(state.time), workspace);
  workspace.velocity = state.v;
  carried_force(*model.carried, state.q, workspace);
  state.carried = carried_state(*model.carried, model.gravity_load, scene.gravity, state.q, state.v, workspace);
}

Energies energies(const StepScene& scene, const State& state) noexcept {
  Energies energies{0.5 * state.v.squaredNorm(), state.elastic_energy, -scene.gravity_force.dot(state.q)};
  if (state.carried) {
    energies.kinetic = state.carried->kinetic_energy;
    energies.potential += state.carried->potential_of_frame;
  }
  if (!state.body) return energies;
  const FreeState& body = *state.body;
  // w . l = w . (J w + h) and (pi - v) . v = w . h.
  const Eigen::Vector3d l = body.orientation.conjugate() * body.angular_momentum;
  energies.kinetic += 0.5 * body.linear_momentum.squaredNorm() / body.mass;
  energies.kinetic += 0.5 * (body.spin.dot(l) + (body.momentum - state.v).dot(state.v));
  energies.potential -= body.mass * scene.gravity.dot(body.position);
  return energies;
}

}  // namespace exmat::runtime
