#include "runtime/sim/step/contact_step.h"

#include <Eigen/LU>
#include <algorithm>

namespace exmat::runtime {
namespace {

BodyPose pose_of(const Model& model, const State& state) {
  BodyPose pose{.q = state.q};
  if (state.carried) {
    pose.position = state.carried->frame.position;
    pose.rotation = state.carried->frame.rotation;
  }
  if (!state.body) return pose;
  pose.position = model.rigid->centre_of_mass() + state.body->position;
  pose.rotation = state.body->orientation.toRotationMatrix();
  return pose;
}

/// Pose and momenta of the solution x of a ContactProblem, into the workspace. Momenta come from the forces of the
/// contacts, or, where these are not balanced for want of convergence, from the way that the body went.
void take_contact_solution(const StepScene& scene, const State& state, bool converged, Workspace& workspace) {
  ContactProblemWorkspace& near = *workspace.near;
  workspace.q = state.q + near.x.tail(state.q.size());
  if (!state.body) return;
  FreeState& body = *workspace.body;
  FreeMotionWorkspace& free = *workspace.free;
  body.position += near.x.head<3>();
  const Eigen::Matrix3d rotation = state.body->orientation.toRotationMatrix() * rotation_of(free.solution.rotation);
  const Eigen::Vector3d deformation = free.moments.deformation.transpose() * free.velocity;
  if (converged) {
    body.angular_momentum += scene.time_step * near.contact.torque;
    free.solution.spin = free.moments.inertia.inverse() * (rotation.transpose() * body.angular_momentum - deformation);
  } else {
    near.contact.force = body.mass / (scene.time_step * scene.time_step) * near.x.head<3>();
    free.solution.spin = free.solution.rotation / scene.time_step;
    body.angular_momentum = rotation * (free.moments.inertia * free.solution.spin + deformation);
  }
  body.linear_momentum += scene.time_step * near.contact.force;
}

void add(const NewtonReport& more, NewtonReport& total) {
  total.status = more.status;
  total.residual = more.residual;
  total.iterations += more.iterations;
  total.factorisations += more.factorisations;
  total.line_search_evaluations += more.line_search_evaluations;
  total.projections += more.projections;
}

}  // namespace

bool is_near_obstacles(const Model& model, const StepScene& scene, const State& state, Workspace& workspace) noexcept {
  if (!touches(model, scene)) return false;
  const StageTimer timer(workspace.profile, Stage::kContact);
  const BodyPose pose = pose_of(model, state);
  BodyVelocity velocity{.v = state.v};
  if (state.body) {
    velocity.linear = state.body->linear_momentum / state.body->mass;
    velocity.angular = pose.rotation * state.body->spin;
  }
  if (state.carried) {
    velocity.linear = state.carried->frame.linear_velocity;
    velocity.angular = state.carried->frame.angular_velocity;
  }
  const ContactSet& set = *model.contact;
  const double dt = scene.time_step;
  double travel = set.travel_bound(pose, velocity, dt);
  if (state.carried) {
    const MotionSample& end = workspace.carried->frame;
    travel = std::max(travel, set.travel_bound(pose, {end.linear_velocity, end.angular_velocity, state.v}, dt));
  }
  const double margin = kContactMarginSteps * travel + dt * dt * scene.gravity.norm();
  ContactWorkspace& contact = workspace.near->contact;
  set.gather(scene.obstacles, static_cast<double>(state.step + 1) * dt, dt, pose, margin, contact);
  if (contact.candidate_count == 0) return false;
  set.freeze(pose, velocity, dt, state.contacts, contact);
  return true;
}

NewtonReport solve_with_contacts(const Model& model, const StepScene& scene, const State& state,
                                 IncrementalPotential& potential, Workspace& workspace) noexcept {
  ContactProblemWorkspace& near = *workspace.near;
  near.x.setZero();
  near.x.tail(state.q.size()) = workspace.q - state.q;
  if (state.body) {
    workspace.free->spin_is_given = true;
    near.x.segment<3>(3) = workspace.free->solution.rotation;
    model.rigid->moments(workspace.q, workspace.free->moments);
  }
  near.newton.profile = workspace.profile;
  ContactProblem problem(model, scene, state, potential, workspace);
  NewtonReport total;
  for (int round = 0; round < kFrictionRounds; ++round) {
    if (round > 0) {
      workspace.q = state.q + near.x.tail(state.q.size());
      potential.start(workspace.q);
    }
    add(newton_minimize(problem, scene.newton, near.x, near.newton), total);
    if (total.status == NewtonStatus::kNonFinite) return total;
    if (model.contact->refresh_friction(near.contact) <= kSameFriction) break;
  }
  take_contact_solution(scene, state, total.status == NewtonStatus::kConverged, workspace);
  return total;
}

void commit_contacts(const Model& model, bool near, const Workspace& workspace, State& state) noexcept {
  if (near)
    model.contact->commit(pose_of(model, state), workspace.near->contact, state.contacts);
  else
    state.contacts.count = 0;
}

}  // namespace exmat::runtime
