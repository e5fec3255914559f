#include "runtime/sim/step/workspace.h"

namespace exmat::runtime {

ContactProblemWorkspace::ContactProblemWorkspace(const Model& model, const StepScene& scene)
    : contact(model.contact ? ContactWorkspace(*model.contact, scene.obstacles.size()) : ContactWorkspace()),
      newton(model.modes() + model.frame->rigid_unknowns()),
      x(Eigen::VectorXd::Zero(model.modes() + model.frame->rigid_unknowns())),
      q(Eigen::VectorXd::Zero(model.modes())),
      gradient_q(q),
      stiffness(Eigen::MatrixXd::Zero(x.size(), x.size())) {
  contact.set_zero(model.modes());
  held.sums.set_zero(model.modes());
}

ExampleWorkspace::ExampleWorkspace(const ExampleModel& model) : weights_solver(model.weights.make_workspace()) {
  if (model.table) target_table = model.table->make_workspace();
  if (model.target) {
    target_solver = model.target->make_workspace();
    solved_target.setZero(model.target->dimension());
  }
  if (model.elasticity) {
    elasticity.emplace(model.elasticity->make_workspace());
    solved_target.setZero(model.elasticity->dimension());
  }
  weights.setZero(model.weights.examples());
  target.setZero(model.filter.rows());
  force.centre = force.pull = target;
}

Workspace::Workspace(const Model& model, const StepScene& scene, bool meets_bodies)
    : newton(model.modes()), elasticity(model.internal_force.make_workspace()), frame(model.frame->make_workspace()) {
  const Eigen::VectorXd zero = Eigen::VectorXd::Zero(model.modes());
  form.velocity_centre = form.acceleration_centre = zero;
  q = v = external_force = internal_force = acceleration = offset = linear = zero;
  frozen_force = next_frozen_force = zero;
  if (model.frame->exerts_forces()) newton.lu.emplace(model.modes());
  if (touches(model, scene) || (model.contact && meets_bodies)) near.emplace(model, scene);
  product.setZero(padded(model.modes()));
  quadratic.setZero(padded(model.modes()), model.modes());
  for (std::size_t i = 0; i < scene.examples.size(); ++i) examples.emplace_back(model.examples[i]);
}

void Workspace::fit(const Model& model, const StepScene& scene, std::span<const Attachment> attachments) {
  if (!near) near.emplace(model, scene);
  near->held = AttachmentWorkspace(attachments, model.modes(), near->x.size());
}

}  // namespace exmat::runtime
