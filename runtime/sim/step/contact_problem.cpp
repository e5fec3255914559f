#include "runtime/sim/step/contact_problem.h"

#include <cmath>

namespace exmat::runtime {

ContactProblem::ContactProblem(const Model& model, const State& state, IncrementalPotential& potential,
                               Workspace& workspace) noexcept
    : model_(model),
      frame_(*model.frame),
      state_(state),
      potential_(potential),
      workspace_(workspace),
      near_(*workspace.near) {}

/// Also q, and what the frame follows from x, in the workspace.
BodyPose ContactProblem::place(const Eigen::VectorXd& x) noexcept {
  near_.q = state_.q + x.tail(near_.q.size());
  return {frame_.place(x, workspace_.frame), near_.q};
}

PotentialEvaluation ContactProblem::evaluate(const Eigen::VectorXd& x, Eigen::VectorXd& gradient,
                                             Eigen::MatrixXd& hessian) noexcept {
  const BodyPose pose = place(x);
  PotentialEvaluation inner = potential_.evaluate(near_.q, near_.gradient_q, workspace_.newton.hessian);
  model_.contact->evaluate(pose, near_.contact);
  PotentialEvaluation evaluation = finish(x, inner, gradient);
  frame_.accept_rigid(workspace_.frame);
  assemble_hessian(pose, x, hessian);
  return evaluation;
}

PotentialEvaluation ContactProblem::evaluate(const Eigen::VectorXd& x, Eigen::VectorXd& gradient) noexcept {
  const BodyPose pose = place(x);
  const PotentialEvaluation inner = potential_.evaluate(near_.q, near_.gradient_q);
  model_.contact->evaluate(pose, near_.contact);
  return finish(x, inner, gradient);
}

PotentialEvaluation ContactProblem::finish(const Eigen::VectorXd& x, const PotentialEvaluation& inner,
                                           Eigen::VectorXd& gradient) noexcept {
  const ContactWorkspace& contact = near_.contact;
  PotentialEvaluation evaluation = inner;
  gradient.tail(near_.q.size()) = near_.gradient_q - contact.generalised;
  const double added = contact.potential + frame_.rigid_potential(x, workspace_.frame);
  frame_.rigid_gradient(x, {contact.force, contact.torque}, workspace_.frame, gradient);
  evaluation.potential.value += added;
  evaluation.potential.magnitude += std::abs(added);
  evaluation.force_scale += contact.generalised.norm();
  evaluation.force_scale += frame_.residual_of(contact.force);
  return evaluation;
}

PotentialValue ContactProblem::value(const Eigen::VectorXd& x) noexcept {
  const BodyPose pose = place(x);
  PotentialValue value = potential_.value(near_.q);
  const double added = model_.contact->potential(pose, near_.contact) + frame_.rigid_potential(x, workspace_.frame);
  value.value += added;
  value.magnitude += std::abs(added);
  return value;
}

void ContactProblem::hessian(const Eigen::VectorXd& x, Tangent tangent, Eigen::MatrixXd& hessian) noexcept {
  const BodyPose pose = place(x);
  potential_.hessian(near_.q, tangent, workspace_.newton.hessian);
  assemble_hessian(pose, x, hessian);
}

void ContactProblem::assemble_hessian(const BodyPose& pose, const Eigen::VectorXd& x,
                                      Eigen::MatrixXd& hessian) noexcept {
  const Eigen::Index modes = near_.q.size();
  hessian.setZero();
  hessian.bottomRightCorner(modes, modes).triangularView<Eigen::Lower>() = workspace_.newton.hessian;
  if (frame_.rigid_unknowns() == 0) {
    model_.contact->add_reduced_stiffness(pose, near_.contact, hessian);
    return;
  }
  near_.stiffness.setZero();
  model_.contact->add_stiffness(pose, near_.contact, near_.stiffness);
  frame_.add_rigid_hessian(x, pose, near_.stiffness, workspace_.frame, hessian);
}

void ContactProblem::accept(PotentialEvaluation& evaluation) noexcept {
  potential_.accept(evaluation);
  evaluation.potential.value += frame_.accept_rigid(workspace_.frame);
}

}  // namespace exmat::runtime
