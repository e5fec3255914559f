#include "runtime/sim/step/contact_step.h"

#include <algorithm>

namespace exmat::runtime {
BodyPose pose_of(const Model& model, const State& state) noexcept {
  return {model.frame->placement(state.frame), state.q};
}

void start_contact(const Model& model, const StepScene& scene, const State& state, Workspace& workspace) noexcept {
  ContactProblemWorkspace& near = *workspace.near;
  near.x.setZero();
  near.x.tail(state.q.size()) = workspace.q - state.q;
  model.frame->begin_contact(state.frame, workspace.q, scene.time_step, workspace.frame, near.x);
}

void finish_contact(const Model& model, const State& state, bool converged, const Eigen::Vector3d& torque,
                    Workspace& workspace) noexcept {
  ContactProblemWorkspace& near = *workspace.near;
  workspace.q = state.q + near.x.tail(state.q.size());
  const ContactSums& held = near.held.sums;
  near.contact.force += held.force;
  model.frame->end_contact(near.x, converged, torque + held.torque, state.frame, workspace.frame, near.contact.force);
  near.contact.force -= held.force;
}

bool is_near_obstacles(const Model& model, const StepScene& scene, double pushed, State& state,
                       Workspace& workspace) noexcept {
  if (workspace.near) workspace.near->contact.candidate_count = 0;
  if (!touches(model, scene)) return false;
  const StageTimer timer(workspace.profile, Stage::kContact);
  const BodyPose pose = pose_of(model, state);
  const BodyVelocity velocity{model.frame->velocity(state.frame), state.v};
  const BodyVelocity expected{model.frame->expected_velocity(state.frame, workspace.frame), state.v};
  const ContactSet& set = *model.contact;
  const double dt = scene.time_step;
  const double travel = std::max({set.travel_bound(pose, velocity, dt), set.travel_bound(pose, expected, dt), pushed});
  const double margin =
      kContactMarginSteps * travel + dt * dt * scene.gravity.norm() + state.contacts.longest_way_out();
  ContactWorkspace& contact = workspace.near->contact;
  set.gather(scene.obstacles, static_cast<double>(state.step + 1) * dt, dt, pose, margin, state.contacts.near_planes,
             contact);
  contact.are_all_planes &= contact.candidate_count > 0;  // else those of an earlier step would be evaluated
  if (contact.candidate_count == 0) return false;
  FrameVelocity loaded = expected;
  loaded.linear += dt * scene.gravity;
  set.freeze(pose, velocity, loaded, dt, state.contacts, contact);
  return true;
}

bool is_isolated(const StepScene& scene, const ContactWorkspace& contact) noexcept {
  const auto moves = [](const PlacedObstacle& placed) { return placed.obstacle->motion.moves(); };
  return !(contact.candidate_count > 0 && std::ranges::any_of(contact.obstacles, moves)) && !runs_examples(scene) &&
         scene.forces.empty();
}

bool is_isolated(const StepScene& scene, const State& state, const ContactWorkspace& contact) noexcept {
  const auto* const free = std::get_if<FreeState>(&state.frame);
  return is_isolated(scene, contact) && !holds_modes(state.attachments) && state.applied_force.isZero(0) &&
         state.vertex_force.isZero(0) &&
         (free == nullptr || (free->applied_force.isZero(0) && free->applied_torque.isZero(0)));
}

void add(const NewtonReport& more, NewtonReport& total) noexcept {
  total.status = more.status;
  total.residual = more.residual;
  total.force_scale = more.force_scale;
  total.iterations += more.iterations;
  total.factorisations += more.factorisations;
  total.line_search_evaluations += more.line_search_evaluations;
  total.projections += more.projections;
}

NewtonReport solve_with_contacts(const Model& model, const StepScene& scene, const State& state,
                                 IncrementalPotential& potential, Workspace& workspace) noexcept {
  ContactProblemWorkspace& near = *workspace.near;
  start_contact(model, scene, state, workspace);
  near.newton.profile = workspace.profile;
  ContactProblem problem(model, state, potential, workspace);
  const NewtonReport total = minimise_near(problem, model, scene, state, potential, workspace);
  if (total.status == NewtonStatus::kNonFinite) return total;
  finish_contact(model, state, total.status == NewtonStatus::kConverged, near.contact.torque, workspace);
  return total;
}

void carry_contacts(const StepScene& scene, const Placement& from, const Placement& to, State& state) noexcept {
  const Eigen::Matrix3d turn = to.rotation * from.rotation.transpose();
  for (std::size_t i = 0; i < state.contacts.count; ++i) {
    HeldContact& held = state.contacts.held[i];
    const MotionSample pose = scene.obstacles[static_cast<std::size_t>(held.obstacle)]->motion.sample(state.time);
    held.anchor = pose.to_frame(to.position + turn * (pose.to_world(held.anchor) - from.position));
    held.way_out.setZero();
  }
  state.contacts.account = ContactState::kUnbounded;
}

void commit_contacts(const Model& model, bool near, Workspace& workspace, State& state) noexcept {
  if (near)
    model.contact->commit(pose_of(model, state), workspace.near->contact, state.contacts);
  else
    state.contacts.count = 0;
}

}  // namespace exmat::runtime
