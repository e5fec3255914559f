#include "runtime/sim/space/full/full_body.h"

#include <algorithm>
#include <span>

#include "runtime/sim/step/example_forces.h"
#include "runtime/sim/step/sleep.h"

namespace exmat::runtime {
namespace {

/// Displacement and velocity in the world where the reduced coordinates place the body.
void set_full(const FullModel& full, const Model& model, const State& state, FullMotion& motion) noexcept {
  motion.q.noalias() = full.basis * state.q;
  motion.v.noalias() = full.basis * state.v;
  if (full.rigid || full.carried) {
    const Placement at = model.frame->placement(state.frame);
    const FrameVelocity velocity = model.frame->velocity(state.frame);
    const Eigen::Matrix4Xd& from_origin = full.rigid ? full.rigid->rest() : full.carried->rest();
    for (Eigen::Index place = 0; place < full.space.vertices(); ++place) {
      const Eigen::Vector3d rest = from_origin.col(place).head<3>();
      const Eigen::Index dof = 3 * static_cast<Eigen::Index>(full.space.number_at(place));
      const Eigen::Vector3d arm = at.rotation * (rest + motion.q.segment<3>(dof));
      motion.v.segment<3>(dof) = velocity.at(arm) + (at.rotation * motion.v.segment<3>(dof)).eval();
      motion.q.segment<3>(dof) = (at.position - at.origin) + (arm - rest);
    }
  }
  motion.q_previous = motion.q;
  motion.v_previous = motion.v;
  motion.a.setZero();
  motion.step = state.step;
  motion.time = state.time;
  motion.elastic_energy = state.elastic_energy;
  motion.begins_anew = true;
}

/// Sets the reduced coordinates and the frame nearest to where the last step has left the body, with its momenta.
void set_reduced(const FullModel& full, const Model& model, const StepScene& scene, Workspace& workspace,
                 FullWorkspace& own, State& state) noexcept {
  const FullMotion& motion = *state.full;
  const Eigen::VectorXd *q = &motion.q, *v = &motion.v;
  FrameMotion frame;
  FrameMomenta momenta;
  if (full.rigid) {
    const RigidWorkspace& rigid = own.potential.rigid;
    momenta = full.rigid->momenta(own.field.data(), rigid);
    frame.position = rigid.centre - full.rigid->centre_at_rest();
    frame.orientation = Eigen::Quaterniond(rigid.rotation);
    frame.linear_velocity = momenta.linear / full.rigid->mass();
    frame.angular_velocity = full.rigid->spin(own.field.data(), rigid);
    RigidPart::add_motion({-frame.linear_velocity, -frame.angular_velocity}, rigid, own.field.data());
    for (Eigen::Index place = 0; place < full.space.vertices(); ++place) {
      const Eigen::Index dof = 3 * static_cast<Eigen::Index>(full.space.number_at(place));
      own.moved.segment<3>(dof) =
          rigid.rotation.transpose() * rigid.arms.col(place).head<3>() - full.rigid->rest().col(place).head<3>();
      own.rate.segment<3>(dof) = rigid.rotation.transpose() * own.field.segment<3>(4 * place);
    }
    q = &own.moved;
    v = &own.rate;
  }
  if (full.carried) {
    const MotionSample at = scene.carrier->sample(motion.time);
    full.carried->own_velocity(at, motion.q, motion.v, own.field);
    full.space.from_field(own.field, own.rate);
    for (Eigen::Index place = 0; place < full.space.vertices(); ++place) {
      const Eigen::Index dof = 3 * static_cast<Eigen::Index>(full.space.number_at(place));
      const Eigen::Vector3d rest = full.carried->rest().col(place).head<3>();
      own.moved.segment<3>(dof) = at.to_frame(rest + motion.q.segment<3>(dof)) - rest;
    }
    q = &own.moved;
    v = &own.rate;
  }
  state.q.noalias() = full.projection.transpose() * *q;
  state.v.noalias() = full.projection.transpose() * *v;
  state.q_previous = state.q;
  state.v_previous = state.v;
  if (full.rigid) model.frame->adopt(frame, momenta, state.q, state.v, workspace.frame, state.frame);
  if (full.carried) model.frame->follow(scene, motion.time, state.q, state.v, workspace.frame, state.frame);
  state.step = motion.step;
  state.time = motion.time;
  state.elastic_energy = motion.elastic_energy;
  state.begins_anew = motion.begins_anew;
}

/// Weights at the first iterate, into the workspace, and the target of the step.
void find_target(const FullModel& full, const Model& model, const StepScene& scene, const State& state,
                 Workspace& workspace, FullStep& step, FullWorkspace& own, StepReport& report) noexcept {
  if (!runs_examples(scene)) return;
  const ExampleSettings& settings = scene.examples.front();
  const FullExamples& examples = *full.examples;
  ExampleWorkspace& scratch = workspace.examples.front();
  if (settings.given_weights.size() == 0) step.first_coefficients(own.coefficients_there);
  set_weights(examples.weights, settings, own.coefficients_there, scratch);
  if (examples.table) {
    examples.table->evaluate(scratch.weights, own.table, own.target);
  } else {
    solve_target(model.examples.front(), settings.target_iterations, state.examples.front(), scratch, report);
    own.target.noalias() = examples.from_target * scratch.solved_target;
  }
  step.set_target(Eigen::Map<const VertexArray>(own.target.data(), full.space.functions(), 3));
}

}  // namespace

void prepare_full(const FullModel& full, State& state) { state.vertex_force.setZero(full.space.size()); }

void enter_full_space(const FullModel& full, const Model& model, State& state) {
  if (state.full) return;
  const Eigen::VectorXd zero = Eigen::VectorXd::Zero(full.space.size());
  FullMotion& motion = state.full.emplace();
  motion.q = motion.v = motion.q_previous = motion.v_previous = motion.a = motion.applied_force = zero;
  if (state.vertex_force.size() == 0) prepare_full(full, state);
  set_full(full, model, state, motion);
}

void leave_full_space(State& state) noexcept {
  state.full.reset();
  state.begins_anew = true;
}

bool asks_for_full_space(const StepScene& scene, const StepReport& last, State& state) noexcept {
  const SpaceSettings& settings = scene.space;
  if (settings.space != Space::kAuto) return settings.space == Space::kFull;
  const double midpoint = state.time + 0.5 * scene.time_step;
  // That of the caller has a part in the modes, which are far fewer than the vertices.
  const bool acts = !state.applied_force.isZero(0) || (settings.contact && last.contacts > 0) ||
                    (settings.forces && std::ranges::any_of(scene.forces, [&](const ScriptedForce& force) {
                       return force.acts_at(midpoint);
                     }));
  if (acts || !state.full) {
    if (state.full) state.full->alone = 0;
    return acts;
  }
  state.full->alone += scene.time_step;
  return state.full->alone < settings.release;
}

void move_full(const FullModel& full, const Model& model, const RigidPlace& before, State& state) noexcept {
  FullMotion& motion = *state.full;
  const Placement at = model.frame->placement(state.frame);
  const FrameVelocity velocity = model.frame->velocity(state.frame);
  const Eigen::Matrix3d turn = at.rotation * before.placement.rotation.transpose();
  for (Eigen::Index place = 0; place < full.space.vertices(); ++place) {
    const Eigen::Vector3d rest = full.rigid->rest().col(place).head<3>() + full.rigid->centre_at_rest();
    const Eigen::Index dof = 3 * static_cast<Eigen::Index>(full.space.number_at(place));
    const Eigen::Vector3d arm = rest + motion.q.segment<3>(dof) - before.placement.position;
    const Eigen::Vector3d own = motion.v.segment<3>(dof) - before.velocity.at(arm);
    const Eigen::Vector3d now = turn * arm;
    motion.q.segment<3>(dof) = at.position + now - rest;
    motion.v.segment<3>(dof) = velocity.at(now) + turn * own;
  }
  motion.q_previous = motion.q;
  motion.v_previous = motion.v;
}

StepReport step_in_full_space(const FullModel& full, const Model& model, const StepScene& scene, State& state,
                              Workspace& workspace, FullWorkspace& own) noexcept {
  if (sleeps(model, scene, state)) return sleep_through(scene, state);
  FullMotion& motion = *state.full;
  motion.step = state.step;
  motion.time = state.time;
  motion.begins_anew = state.begins_anew;
  motion.applied_force = state.vertex_force;
  const bool may_touch = full.contacts && !scene.obstacles.empty();
  ContactWorkspace* const found = workspace.near ? &workspace.near->contact : nullptr;
  if (found != nullptr) found->candidate_count = 0;
  FullStep step(full, scene, motion, own, may_touch ? FullContactMemory{&state.contacts, found} : FullContactMemory{});
  step.begin();
  StepReport target;
  find_target(full, model, scene, state, workspace, step, own, target);
  if ((target.status & kStepNonFinite) != 0) return target;
  step.solve();
  StepReport report = step.finish();
  report.status |= target.status;
  report.target_iterations = target.target_iterations;
  if ((report.status & kStepNonFinite) != 0) return report;
  set_reduced(full, model, scene, workspace, own, state);
  commit_weights(scene, workspace, state);
  commit_targets(model, scene, workspace, state);
  if (step.is_near()) {
    const Eigen::Vector3d centre = model.frame->placement(state.frame).position;
    for (ContactCandidate& candidate : std::span(found->candidates).first(found->candidate_count))
      candidate.arm -= centre;
    found->torque -= centre.cross(found->force);
  }
  if (rests(model, scene, report, state)) {
    put_to_sleep(model, state, workspace);
    motion.v.setZero();
    motion.v_previous.setZero();
    motion.q_previous = motion.q;
  }
  return report;
}

Eigen::Vector3d full_displacement(const FullModel& full, const Placement& frame, const FullMotion& motion,
                                  Eigen::Index vertex) noexcept {
  const std::int32_t own = full.space.number(vertex);
  if (own >= 0) return motion.q.segment<3>(3 * own);
  if (!full.carried) return Eigen::Vector3d::Zero();
  const Eigen::Vector3d rest = full.carried->rest().col(full.space.place(vertex)).head<3>();
  return frame.to_world(rest) - rest;
}

Eigen::Vector3d full_velocity(const FullModel& full, const Placement& frame, const FrameVelocity& velocity,
                              const FullMotion& motion, Eigen::Index vertex) noexcept {
  const std::int32_t own = full.space.number(vertex);
  if (own >= 0) return motion.v.segment<3>(3 * own);
  if (!full.carried) return Eigen::Vector3d::Zero();
  const Eigen::Vector3d rest = full.carried->rest().col(full.space.place(vertex)).head<3>();
  return velocity.at(frame.rotation * rest);
}

Energies energies(const FullModel* full, const Model& model, const StepScene& scene, const State& state) noexcept {
  if (!state.full) return energies(model, scene, state);
  return energies_of(*full, scene, *state.full);
}

}  // namespace exmat::runtime
