#include "runtime/sim/state.h"

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
  auto scratch = model.elasticity.make_workspace();
  state.elastic_energy = model.elasticity.energy(q, scratch);
  if (model.examples) {
    state.weights = Eigen::VectorXd::Unit(model.example_count(), 0);
    state.target = Eigen::VectorXd::Zero(model.examples->target.dimension());
  }
  return state;
}

}  // namespace exmat::runtime
