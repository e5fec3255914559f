#include "runtime/sim/step/body_step.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

#include "runtime/sim/step/attached_problem.h"
#include "runtime/sim/step/contact_step.h"
#include "runtime/sim/step/example_forces.h"
#include "runtime/sim/step/sleep.h"
#include "runtime/sim/step/stepper.h"

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

/// Integrator that resolves a step: backward Euler where a body that is not clamped in the world turns too far in it
/// for anything of second order. A hold on a body is exact at the end of steps, which Newmark's forces would oscillate
/// about: BDF2.
Integrator integrator_of_step(const Model& model, const StepScene& scene, const State& state, bool near, bool held) {
  const bool resolved = !near && model.frame->turn_rate(state.frame) * scene.time_step <= kResolvedTurn;
  if (!resolved || (held && begins_anew(model, scene, state))) return Integrator::kBackwardEuler;
  return held && scene.integrator == Integrator::kNewmark ? Integrator::kBdf2 : scene.integrator;
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
  const bool anew = begins_anew(model, scene, state);
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
/// That comes with a stiffness, which costs as much as the rest of a step: so the one that was lower in the last step
/// has it first. No result depends on this: where the two are not clearly apart, the energy alone decides.
void choose_first_iterate(const StepScene& scene, const State& state, IncrementalPotential& potential,
                          Workspace& workspace, StepReport& report) {
  workspace.q = state.q + scene.time_step * state.v;
  const bool begins_with_predictor = workspace.predictor_was_lower || workspace.q == state.q;
  const double at_start = potential.potential_at_start();
  const double first = begins_with_predictor ? potential.start(workspace.q) : potential.potential_of_start(workspace.q);
  if (workspace.q == state.q) return;
  const bool is_clear = are_clearly_apart(first, at_start, potential.elastic_energy());
  const bool is_decided = !begins_with_predictor || is_clear;
  const double predicted = is_decided ? first : potential.potential_of_start(workspace.q);
  workspace.predictor_was_lower = predicted <= at_start;
  if (workspace.predictor_was_lower) {
    if (!begins_with_predictor) potential.start(workspace.q);
    return;
  }
  ++report.line_search_evaluations;
  workspace.q = state.q;
  potential.start(workspace.q);
}

/// Arithmetic on subnormal numbers takes a hundred times as long, and a body that comes to rest is full of them.
bool flush_subnormals(Eigen::VectorXd& numbers) {
  const auto is_subnormal = [](double number) {
    return (std::abs(number) < std::numeric_limits<double>::min()) & (number != 0);
  };
  std::int64_t found = 0;  // as wide as the numbers, for whole registers of them
  for (const double number : numbers) found |= is_subnormal(number) ? 1 : 0;
  if (found == 0) return false;
  for (double& number : numbers)
    if (is_subnormal(number)) number = 0;
  return true;
}

/// Without a branch for each number: what is not finite is not zero times zero either.
bool are_finite(const Eigen::VectorXd& numbers) { return (0 * numbers.array()).sum() == 0; }

void commit(const Model& model, const StepScene& scene, double elastic_energy, Workspace& workspace, State& state) {
  const StepForm& form = workspace.form;
  state.q_previous = state.q;
  state.v_previous = state.v;
  state.q = workspace.q;
  state.v = workspace.v;
  state.a = form.acceleration_factor * (state.q - form.acceleration_centre);
  model.frame->commit(scene, form.velocity_factor, state.q, state.v, state.a, workspace.frame, state.frame);
  state.elastic_energy = elastic_energy;
  state.contacts.first_step = false;
  ++state.step;
  state.time = static_cast<double>(state.step) * scene.time_step;
  commit_weights(scene, workspace, state);
  commit_targets(model, scene, workspace, state);
}

}  // namespace

void add_newton_report(const NewtonReport& newton, StepReport& report) noexcept {
  report.newton_iterations = newton.iterations;
  report.line_search_evaluations += newton.line_search_evaluations;
  report.factorisations = newton.factorisations;
  report.projections = newton.projections;
  report.residual = newton.residual;
  if (newton.status == NewtonStatus::kNonFinite) report.status |= kStepNonFinite;
  if (newton.status == NewtonStatus::kIterationLimit) report.status |= kStepIterationLimit;
  if (newton.status == NewtonStatus::kStagnated || newton.status == NewtonStatus::kAboveStart)
    report.status |= kStepStagnated;
}

bool begins_anew(const Model& model, const StepScene& scene, const State& state) noexcept {
  if (state.begins_anew || scene.begins_anew) return true;
  const double midpoint = state.time + 0.5 * scene.time_step;
  const double before = midpoint - scene.time_step;
  return scene.forces_jump(before, midpoint) || model.frame->jumps(scene, before, midpoint);
}

BodyStep::BodyStep(const Model& model, const StepScene& scene, State& state, Workspace& workspace) noexcept
    : model_(model),
      scene_(scene),
      state_(state),
      workspace_(workspace),
      in_frame_(frame_step(scene, state)),
      potential_(model, scene, state, workspace),
      held_(holds_modes(state.attachments)) {}

void BodyStep::begin(bool touches_others, double pushed) noexcept {
  const BodyFrame& frame = *model_.frame;
  frame.begin(in_frame_, workspace_.frame, workspace_.external_force);
  near_ = is_near_obstacles(model_, scene_, pushed, state_, workspace_) || touches_others;
  const Integrator integrator = integrator_of_step(model_, scene_, state_, near_, held_);
  frame.move(in_frame_, near_ || held_, integrator == Integrator::kBackwardEuler, state_.frame, workspace_.frame,
             workspace_.external_force);
  prepare_integrator(model_, scene_, in_frame_, integrator, state_, workspace_, report_);
  workspace_.newton.profile = workspace_.profile;
}

bool BodyStep::prepare() noexcept {
  choose_first_iterate(scene_, state_, potential_, workspace_, report_);
  if (!workspace_.q.allFinite() || !find_targets()) return false;
  potential_.prepare();
  return true;
}

bool BodyStep::find_targets() noexcept {
  if (!runs_examples(scene_)) return true;
  update_targets(model_, scene_, state_, workspace_.q, workspace_, report_);
  if (report_.status & kStepNonFinite) return false;
  prepare_example_forces(scene_, workspace_);
  return true;
}

NewtonReport BodyStep::solve_once() noexcept {
  NewtonReport failed;
  failed.status = NewtonStatus::kNonFinite;
  if (!prepare()) return failed;
  if (held_) return solve_attached(model_, scene_, state_, potential_, workspace_);
  return near_ ? solve_with_contacts(model_, scene_, state_, potential_, workspace_)
               : newton_minimise(potential_, scene_.newton, workspace_.q, workspace_.newton);
}

NewtonReport BodyStep::solve() noexcept {
  const NewtonReport newton = solve_once();
  if (newton.status != NewtonStatus::kNonFinite || near_ || held_) return newton;
  if (!model_.frame->fall_back(in_frame_, workspace_.frame)) return newton;
  backward_euler_form(history_of(model_, state_), scene_.time_step, workspace_.form);
  return solve_once();
}

StepReport BodyStep::finish(const NewtonReport& newton) noexcept {
  const bool unbalanced = near_ && !held_ && newton.status != NewtonStatus::kConverged;
  const bool closed = near_ && !held_ && !model_.frame->is_driven() && workspace_.near->contact.loaded_count > 0 &&
                      is_isolated(scene_, state_, workspace_.near->contact);
  const Energies before = unbalanced || closed ? energies(model_, scene_, state_) : Energies{};
  const double springs = closed ? workspace_.near->contact.start_energy(state_.contacts) : 0;
  take(newton);
  const bool finite = (report_.status & kStepNonFinite) == 0;
  const double held =
      near_ && finite ? workspace_.near->contact.end_energy(model_.frame->placement(state_.frame).position) : 0;
  if (finite) state_.contacts.account = held;
  if ((unbalanced || closed) && finite) {
    const Energies now = energies(model_, scene_, state_);
    double allowed = before.total() - now.elastic - now.potential, rounding = 0;
    const double all = allowed + springs;
    if (closed) {
      // Springs of vertices that the step has brought deep, as through an edge, were paid for by nobody.
      allowed += unbalanced ? std::min(0.0, springs - held) : springs - held;
      if (!unbalanced)
        rounding = kEnergyRounding * (std::abs(before.total() + springs) + before.kinetic + springs + held);
    }
    const bool gains = now.kinetic > allowed + rounding;
    if (gains) limit_kinetic_energy(allowed);
    if (closed) state_.contacts.account = std::min(held, all - (gains ? std::max(0.0, allowed) : now.kinetic));
  }
  if (rests(model_, scene_, report_, state_)) put_to_sleep(model_, state_, workspace_);
  return report_;
}

const StepReport& BodyStep::take(const NewtonReport& newton) noexcept {
  add_newton_report(newton, report_);
  Workspace& workspace = workspace_;
  workspace.v = workspace.form.velocity_factor * (workspace.q - workspace.form.velocity_centre);
  const bool finite = are_finite(workspace.q) && are_finite(workspace.v) && model_.frame->is_finite(workspace.frame) &&
                      (!near_ || workspace.near->contact.force.allFinite());
  if (!finite) report_.status |= kStepNonFinite;
  if (report_.status & kStepNonFinite) return report_;
  if (near_) {
    report_.contacts = workspace.near->contact.touching;
    report_.contact_force = workspace.near->contact.force;
  }
  const bool small_q = flush_subnormals(workspace.q), small_v = flush_subnormals(workspace.v);
  if (small_q || small_v) report_.status |= kStepSubnormal;
  commit(model_, scene_, potential_.elastic_energy(), workspace, state_);
  state_.begins_anew = near_;
  commit_contacts(model_, near_, workspace, state_);
  if (held_ && end_attachments(pose_of(model_, state_), workspace.near->held, state_.attachments))
    state_.begins_anew = true;
  return report_;
}

void BodyStep::limit_kinetic_energy(double allowed) noexcept {
  const double limit = std::max(0.0, allowed);
  if (model_.frame->is_driven() || model_.frame->kinetic_energy(state_.v, state_.frame) <= limit) return;
  const Eigen::Vector3d impulse = scene_.time_step * report_.contact_force;
  const Eigen::Vector3d lost =
      model_.frame->limit_kinetic_energy(limit, impulse, workspace_.frame, state_.v, state_.frame);
  report_.contact_force -= lost / scene_.time_step;
}

void BodyStep::add_motion(double share, const FrameVelocity& added) noexcept {
  const std::optional<FrameMomenta> before = model_.frame->momenta(state_.frame);
  model_.frame->add_motion(share, added, workspace_.frame, state_.v, state_.frame);
  if (!before) return;
  const Eigen::Vector3d gained = model_.frame->momenta(state_.frame)->linear - before->linear;
  report_.contact_force += gained / scene_.time_step;
}

}  // namespace exmat::runtime
