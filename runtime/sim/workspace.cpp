#include "runtime/sim/workspace.h"

namespace exmat::runtime {

Workspace::Workspace(const Model& model, const StepScene& scene)
    : newton(model.modes()), elasticity(model.elasticity.make_workspace()) {
  const Eigen::VectorXd zero = Eigen::VectorXd::Zero(model.modes());
  form.velocity_centre = form.acceleration_centre = zero;
  q = predictor = external_force = internal_force = acceleration = offset = product = zero;
  if (scene.stiffness_damping > 0) damping.setZero(model.modes(), model.modes());
  if (!runs_examples(model, scene)) return;
  weights_solver = model.examples->weights.make_workspace();
  target_solver = model.examples->target.make_workspace();
  weights.setZero(model.example_count());
  target.setZero(model.examples->target.dimension());
  example_force.centre = example_force.pull = skew_force = zero;
}

}  // namespace exmat::runtime
