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

FullMemory full_memory(const FullModel& full, const StepScene& scene, State& state, Workspace& workspace) noexcept {
  FullMemory memory{.attachments = state.attachments};
  if (full.contacts && !scene.obstacles.empty()) {
    memory.held = &state.contacts;
    memory.found = &workspace.near->contact;
  }
  if (full.skin) memory.bones = &*state.full->skeleton;
  return memory;
}

bool is_shifted(const State& state) noexcept {
  return state.full && state.full->skeleton && state.full->skeleton->weights.size() > 0;
}

bool reads_pose(const ExampleSettings& one) noexcept {
  return acts(one) && !is_driven(one) && one.given_weights.size() == 0;
}

/// Weights by which examples shift the body, where its shape does not make them.
const Eigen::VectorXd& known_shifts(const StepScene& scene, const State& state) noexcept {
  const bool is_given = !scene.examples.empty() && scene.examples.front().given_weights.size() > 0;
  return is_given ? scene.examples.front().given_weights : state.examples.front().weights;
}

/// Puts the body where its bones and its shifts are; what it is displaced by beside them stays.
void place_on_bones(const FullModel& full, State& state) noexcept {
  FullMotion& motion = *state.full;
  SkeletonMotion& own = *motion.skeleton;
  for (Eigen::Index place = 0; place < full.space.places(); ++place) {
    const SkinPlace at = full.skin->place(own.bones, own.weights, place);
    if (place < full.space.vertices()) {
      const Eigen::Index dof = 3 * static_cast<Eigen::Index>(full.space.number_at(place));
      motion.q.segment<3>(dof) = full.skin->displacement(at, place) + at.turn * own.own.segment<3>(dof);
    } else {
      own.q.segment<3>(3 * (place - full.space.vertices())) = full.skin->displacement(at, place);
    }
  }
  motion.v.setZero();
  motion.q_previous = motion.q;
  motion.v_previous.setZero();
  own.v.setZero();
  own.q_previous = own.q;
  own.v_previous.setZero();
  own.own_previous = own.own;
  own.way_previous.setZero();
  own.anew = motion.begins_anew = state.begins_anew = true;
}

/// Weights at the first iterate, into the workspace, and the targets of the step.
void find_targets(const FullModel& full, const Model& model, const StepScene& scene, const State& state,
                  Workspace& workspace, FullStep& step, FullWorkspace& own, StepReport& report) noexcept {
  if (!runs_examples(scene)) return;
  const bool shifted = is_shifted(state);
  if (!shifted && std::ranges::any_of(scene.examples, reads_pose)) step.first_coefficients();
  for (std::size_t group = 0; group < scene.examples.size(); ++group) {
    const ExampleSettings& settings = scene.examples[group];
    if (!acts(settings)) continue;
    const FullExamples& examples = full.examples[group];
    const ExampleModel& reduced = model.examples[group];
    ExampleWorkspace& scratch = workspace.examples[group];
    FullWorkspace::Examples& found = own.examples[group];
    if (is_driven(settings))
      drive(settings.drivers, *model.skeleton, state.full->skeleton->next, scratch.weights);
    else if (!shifted || !reads_pose(settings))
      set_weights(examples.weights, settings, found.coefficients, scratch);
    if (!reduced.table)
      solve_target(reduced, settings.target_iterations, state.examples[group], scratch, report);
    else if (settings.elastic)
      reduced.table->evaluate(scratch.weights, scratch.target_table, scratch.solved_target);
    if (settings.elastic) {
      own.moved.noalias() = examples.shapes * scratch.solved_target;
      step.set_elastic_target(group, own.moved);
      continue;
    }
    if (examples.table)
      examples.table->evaluate(scratch.weights, found.table, found.target);
    else
      found.target.noalias() = examples.from_target * scratch.solved_target;
    step.set_target(group, found.target);
  }
  step.take_elastic_targets();
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
  if (!full.skin) return;
  SkeletonMotion& bones = motion.skeleton.emplace();
  bones.own = motion.q;
  bones.own_previous = bones.way_previous = zero;
  bones.q.setZero(3 * full.space.driven());
  bones.v = bones.q_previous = bones.v_previous = bones.q;
  bones.bones = bones.next = model.skeleton->bound();
  if (!full.examples.empty() && full.examples.front().shifts.size() > 0) bones.weights = state.examples.front().weights;
  put_on_bones(full, bones.bones, state);
}

void put_on_bones(const FullModel& full, const BonePoses& bones, State& state) noexcept {
  SkeletonMotion& own = *state.full->skeleton;
  std::ranges::copy(bones, own.bones.begin());
  std::ranges::copy(bones, own.next.begin());
  place_on_bones(full, state);
}

void put_by_shifts(const FullModel& full, const StepScene& scene, State& state) noexcept {
  if (!is_shifted(state) || !state.full->skeleton->anew) return;
  state.full->skeleton->weights = known_shifts(scene, state);
  place_on_bones(full, state);
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
  const bool acts =
      !state.applied_force.isZero(0) || is_held(state.attachments) || (settings.contact && last.contacts > 0) ||
      (settings.forces &&
       std::ranges::any_of(scene.forces, [&](const ScriptedForce& force) { return force.acts_at(midpoint); }));
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

FullBodyStep::FullBodyStep(const FullModel& full, const Model& model, const StepScene& scene, State& state,
                           Workspace& workspace, FullWorkspace& own) noexcept
    : full_(full),
      model_(model),
      scene_(scene),
      state_(state),
      workspace_(workspace),
      own_(own),
      step_(full, scene, *state.full, own, full_memory(full, scene, state, workspace)) {}

void FullBodyStep::take_time() noexcept {
  FullMotion& motion = *state_.full;
  motion.step = state_.step;
  motion.time = state_.time;
  motion.begins_anew = state_.begins_anew;
}

void FullBodyStep::stand() noexcept {
  take_time();
  step_.stand();
  find_targets(full_, model_, scene_, state_, workspace_, step_, own_, report_);
}

void FullBodyStep::push(Eigen::VectorXd& impulses) noexcept {
  step_.push(impulses);
  set_reduced();
  wake(state_);
  state_.full->alone = 0;
}

bool FullBodyStep::begin(bool touches_others, double pushed) noexcept {
  take_time();
  state_.full->applied_force = state_.vertex_force;
  if (is_shifted(state_)) choose_shifts();
  if (workspace_.near) {
    workspace_.near->contact.candidate_count = 0;
    workspace_.near->contact.set_zero(workspace_.near->contact.generalised.size());
  }
  step_.begin(touches_others, pushed);
  find_targets(full_, model_, scene_, state_, workspace_, step_, own_, report_);
  return (report_.status & kStepNonFinite) == 0;
}

// The shape makes them where the step begins, with the shifts that it has: they do not depend on those that they make.
void FullBodyStep::choose_shifts() noexcept {
  SkeletonMotion& bones = *state_.full->skeleton;
  if (scene_.examples.empty() || !reads_pose(scene_.examples.front())) {
    bones.weights = known_shifts(scene_, state_);
    return;
  }
  const FullExamples& examples = full_.examples.front();
  ExampleWorkspace& scratch = workspace_.examples.front();
  Eigen::VectorXd& coefficients = own_.examples.front().coefficients;
  step_.own_coefficients();
  coefficients.noalias() += examples.shifts * bones.weights;
  set_weights(examples.weights, scene_.examples.front(), coefficients, scratch);
  bones.weights = scratch.weights;
}

/// Sets the reduced coordinates and the frame nearest to where the body is, with its momenta.
void FullBodyStep::set_reduced() noexcept {
  const FullModel& full = full_;
  FullWorkspace& own = own_;
  const FullMotion& motion = *state_.full;
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
    const MotionSample at = scene_.carrier->sample(motion.time);
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
  if (full.skin) {
    const SkeletonMotion& bones = *motion.skeleton;
    own.rate = (bones.own - bones.own_previous) / scene_.time_step;
    q = &bones.own;
    v = &own.rate;
  }
  const auto project = [&](const Eigen::VectorXd& from, Eigen::VectorXd& to) {
    const Eigen::Index columns = padded(to.size());
    kernels().matrix_vector(full.projection.data(), columns, from.size(), columns, from.data(), own.modes.data());
    std::copy_n(own.modes.data(), to.size(), to.data());
  };
  project(*q, state_.q);
  project(*v, state_.v);
  state_.q_previous = state_.q;
  state_.v_previous = state_.v;
  if (full.rigid) model_.frame->adopt(frame, momenta, state_.q, state_.v, workspace_.frame, state_.frame);
  if (full.carried) model_.frame->follow(scene_, motion.time, state_.q, state_.v, workspace_.frame, state_.frame);
  state_.step = motion.step;
  state_.time = motion.time;
  state_.elastic_energy = motion.elastic_energy;
  state_.begins_anew = motion.begins_anew;
  state_.contacts.first_step = false;
}

const StepReport& FullBodyStep::finish(const FrameMomenta& others) noexcept {
  const StepReport target = report_;
  report_ = step_.finish(others);
  report_.status |= target.status;
  report_.target_iterations = target.target_iterations;
  if ((report_.status & kStepNonFinite) != 0) return report_;
  set_reduced();
  commit_weights(scene_, workspace_, state_);
  commit_targets(model_, scene_, workspace_, state_);
  if (step_.is_near()) {
    ContactWorkspace& found = workspace_.near->contact;
    const Eigen::Vector3d centre = model_.frame->placement(state_.frame).position;
    for (ContactCandidate& candidate : std::span(found.candidates).first(found.candidate_count))
      candidate.arm -= centre;
    found.torque -= centre.cross(found.force);
  }
  return report_;
}

void FullBodyStep::add_motion(double share, const FrameVelocity& added) noexcept {
  step_.add_motion(share, added);
  set_reduced();
}

void FullBodyStep::put(const Eigen::VectorXd& q, double elastic_energy, const Eigen::Vector3d& way) noexcept {
  FullMotion& motion = *state_.full;
  for (Eigen::Index i = 0; i < q.size(); i += 3) motion.q.segment<3>(i) = q.segment<3>(i) + way;
  motion.elastic_energy = elastic_energy;
  full_.space.to_field(motion.q, own_.trial);
  std::ranges::copy(own_.trial, own_.potential.x.data());
  if (full_.rigid) full_.rigid->place(own_.trial.data(), own_.potential.rigid);
  add_motion(0, {});
}

StepReport step_in_full_space(const FullModel& full, const Model& model, const StepScene& scene, State& state,
                              Workspace& workspace, FullWorkspace& own) noexcept {
  if (sleeps(model, scene, state)) return sleep_through(scene, state);
  FullBodyStep step(full, model, scene, state, workspace, own);
  if (!step.begin()) return step.report();
  step.step().solve();
  const StepReport report = step.finish();
  if ((report.status & kStepNonFinite) == 0 && rests(model, scene, report, state))
    put_full_to_sleep(model, state, workspace);
  return report;
}

void put_full_to_sleep(const Model& model, State& state, Workspace& workspace) noexcept {
  put_to_sleep(model, state, workspace);
  FullMotion& motion = *state.full;
  motion.v.setZero();
  motion.v_previous.setZero();
  motion.q_previous = motion.q;
}

Eigen::Vector3d full_displacement(const FullModel& full, const Placement& frame, const FullMotion& motion,
                                  Eigen::Index vertex) noexcept {
  const std::int32_t own = full.space.number(vertex);
  if (own >= 0) return motion.q.segment<3>(3 * own);
  if (full.skin) return motion.skeleton->q.segment<3>(3 * (full.space.place(vertex) - full.space.vertices()));
  if (!full.carried) return Eigen::Vector3d::Zero();
  const Eigen::Vector3d rest = full.carried->rest().col(full.space.place(vertex)).head<3>();
  return frame.to_world(rest) - rest;
}

Eigen::Vector3d full_velocity(const FullModel& full, const Placement& frame, const FrameVelocity& velocity,
                              const FullMotion& motion, Eigen::Index vertex) noexcept {
  const std::int32_t own = full.space.number(vertex);
  if (own >= 0) return motion.v.segment<3>(3 * own);
  if (full.skin) return motion.skeleton->v.segment<3>(3 * (full.space.place(vertex) - full.space.vertices()));
  if (!full.carried) return Eigen::Vector3d::Zero();
  const Eigen::Vector3d rest = full.carried->rest().col(full.space.place(vertex)).head<3>();
  return velocity.at(frame.rotation * rest);
}

Energies energies(const FullModel* full, const Model& model, const StepScene& scene, const State& state,
                  FullWorkspace* own) noexcept {
  if (!state.full) return energies(model, scene, state);
  const SkeletonMotion* const bones = state.full->skeleton ? &*state.full->skeleton : nullptr;
  Energies now = energies_of(*full, scene, *state.full, bones);
  if (own != nullptr && !state.full->begins_anew) now.elastic = elastic_energy(*full, scene, *state.full, *own, bones);
  return now;
}

}  // namespace exmat::runtime
