#include "runtime/sim/step/state.h"

namespace exmat::runtime {

State make_state(const Model& model) {
  const Eigen::VectorXd zero = Eigen::VectorXd::Zero(model.modes());
  return make_state(model, zero, zero);
}

State make_state(const Model& model, const Eigen::VectorXd& q, const Eigen::VectorXd& v) {
  State state;
  state.q = state.q_previous = q;
  state.v = state.v_previous = v;
  state.a = Eigen::VectorXd::Zero(model.modes());
  state.applied_force = Eigen::VectorXd::Zero(model.modes());
  auto scratch = model.internal_force.make_workspace();
  state.elastic_energy = model.internal_force.energy(q, scratch);
  if (model.rigid) {
    state.body.emplace();
    set_motion(model, {}, state);
  }
  for (const ExampleModel& examples : model.examples) {
    ExampleState& start = state.examples.emplace_back();
    start.weights = Eigen::VectorXd::Unit(examples.weights.examples(), 0);
    if (examples.target) start.target = Eigen::VectorXd::Zero(examples.target->dimension());
  }
  return state;
}

void prepare_contacts(const Model& model, std::size_t obstacles, State& state) {
  if (model.contact) state.contacts = model.contact->make_state(obstacles);
}

FreeMotion motion_of(const FreeState& body) {
  return {body.position, body.orientation, body.linear_momentum / body.mass, body.orientation * body.spin};
}

FreeMotion motion_of(const MotionSample& frame) {
  return {frame.position, Eigen::Quaterniond(frame.rotation), frame.linear_velocity, frame.angular_velocity};
}

void set_motion(const Model& model, const FreeMotion& motion, State& state) {
  auto moments = model.rigid->make_moments();
  set_motion(model, motion, moments, state);
}

void set_motion(const Model& model, const FreeMotion& motion, RigidFrame::Moments& moments, State& state) {
  FreeState& body = *state.body;
  model.rigid->moments(state.q, moments);
  body.mass = model.rigid->mass();
  body.position = motion.position;
  body.orientation = motion.orientation.normalized();
  body.spin = body.orientation.conjugate() * motion.angular_velocity;
  body.linear_momentum = model.rigid->mass() * motion.linear_velocity;
  body.angular_momentum = body.orientation * (moments.inertia * body.spin + moments.deformation.transpose() * state.v);
  body.momentum = state.v + moments.deformation.lazyProduct(body.spin);
  body.momentum_previous = body.momentum;
}

}  // namespace exmat::runtime
