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
  state.frame = model.frame->make_state();
  set_motion(model, {}, state);
  for (const ExampleModel& examples : model.examples) {
    ExampleState& start = state.examples.emplace_back();
    start.weights = Eigen::VectorXd::Unit(examples.weights.examples(), 0);
    if (examples.target) start.target = Eigen::VectorXd::Zero(examples.target->dimension());
  }
  return state;
}

void prepare_contacts(const Model& model, std::size_t obstacles, State& state) {
  if (!model.contact) return;
  const ContactSet& set = *model.contact;
  state.contacts.held.resize(obstacles * static_cast<std::size_t>(set.vertices()));
  state.contacts.near_planes = NearPlanes(set.vertices(), set.modes(), obstacles);
}

bool set_motion(const Model& model, const FrameMotion& motion, State& state) {
  FrameWorkspace workspace = model.frame->make_workspace();
  return model.frame->set_motion(motion, state.q, state.v, workspace, state.frame);
}

}  // namespace exmat::runtime
