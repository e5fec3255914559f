#include "runtime/sim/step/contact_problem.h"

#include <cmath>
#include <limits>

namespace exmat::runtime {
namespace {

constexpr double kGapRounding = 4 * std::numeric_limits<double>::epsilon();  // of the place of a vertex

}  // namespace

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
  PotentialEvaluation evaluation = finish(x, evaluate_alone(x, /*first=*/true), gradient);
  const BodyPose pose = place(x);
  evaluation.potential.value += frame_.accept_rigid(workspace_.frame);
  start_stiffness(pose);
  finish_hessian(pose, x, hessian);
  return evaluation;
}

PotentialEvaluation ContactProblem::evaluate(const Eigen::VectorXd& x, Eigen::VectorXd& gradient) noexcept {
  return finish(x, evaluate_alone(x, /*first=*/false), gradient);
}

PotentialEvaluation ContactProblem::evaluate_alone(const Eigen::VectorXd& x, bool first) noexcept {
  const BodyPose pose = place(x);
  const PotentialEvaluation alone = first ? potential_.evaluate(near_.q, near_.gradient_q, workspace_.newton.hessian)
                                          : potential_.evaluate(near_.q, near_.gradient_q);
  evaluate_outside(pose);
  return alone;
}

void ContactProblem::evaluate_outside(const BodyPose& pose) noexcept {
  if (model_.contact) {
    model_.contact->evaluate(pose, near_.contact);
    near_.extent = pose.position.norm() + model_.contact->reach();
  }
  evaluate_springs(state_.attachments, potential_.rate(), pose, near_.held);
}

PotentialEvaluation ContactProblem::finish(const Eigen::VectorXd& x, const PotentialEvaluation& alone,
                                           Eigen::VectorXd& gradient) noexcept {
  const ContactWorkspace& contact = near_.contact;
  PotentialEvaluation evaluation = alone;
  const ContactSums& held = near_.held.sums;
  gradient.tail(near_.q.size()) = near_.gradient_q - contact.generalised - held.generalised;
  const double added = contact.potential + held.potential + frame_.rigid_potential(x, workspace_.frame);
  frame_.rigid_gradient(x, {contact.force + held.force, contact.torque + held.torque}, workspace_.frame, gradient);
  evaluation.potential.value += added;
  evaluation.potential.magnitude += std::abs(added);
  evaluation.force_scale += contact.generalised.norm() + held.generalised.norm();
  // A gap is known to the rounding of where its vertex is: no residual comes below what that makes of its force.
  const double rounding = kGapRounding * near_.extent * (contact.stiffness + held.stiffness) / potential_.tolerance();
  evaluation.force_scale += frame_.residual_of(contact.force) + frame_.residual_of({rounding, 0, 0});
  evaluation.force_scale += frame_.residual_of(held.force);
  return evaluation;
}

PotentialValue ContactProblem::value(const Eigen::VectorXd& x) noexcept {
  const BodyPose pose = place(x);
  PotentialValue value = potential_.value(near_.q);
  const double touching = model_.contact ? model_.contact->potential(pose, near_.contact) : 0;
  const double added = touching + spring_potential(state_.attachments, potential_.rate(), pose) +
                       frame_.rigid_potential(x, workspace_.frame);
  value.value += added;
  value.magnitude += std::abs(added);
  return value;
}

void ContactProblem::hessian(const Eigen::VectorXd& x, Tangent tangent, Eigen::MatrixXd& hessian) noexcept {
  const BodyPose pose = place(x);
  evaluate_elastic_hessian(pose, tangent);
  start_stiffness(pose);
  finish_hessian(pose, x, hessian);
}

void ContactProblem::evaluate_elastic_hessian(const BodyPose& pose, Tangent tangent) noexcept {
  potential_.hessian(pose.q, tangent, workspace_.newton.hessian);
}

void ContactProblem::start_stiffness(const BodyPose& pose) noexcept {
  near_.stiffness.setZero();
  add_spring_stiffness(state_.attachments, potential_.rate(), pose, near_.stiffness);
  if (!model_.contact) return;
  if (frame_.rigid_unknowns() == 0)
    model_.contact->add_reduced_stiffness(pose, near_.contact, near_.stiffness);
  else
    model_.contact->add_stiffness(pose, near_.contact, near_.stiffness);
}

void ContactProblem::finish_hessian(const BodyPose& pose, const Eigen::VectorXd& x, Eigen::MatrixXd& hessian) noexcept {
  const Eigen::Index modes = near_.q.size();
  hessian.setZero();
  hessian.bottomRightCorner(modes, modes).triangularView<Eigen::Lower>() = workspace_.newton.hessian;
  if (frame_.rigid_unknowns() == 0)
    hessian.triangularView<Eigen::Lower>() += near_.stiffness;
  else
    frame_.add_rigid_hessian(x, pose, near_.stiffness, workspace_.frame, hessian);
}

void ContactProblem::accept(PotentialEvaluation& evaluation) noexcept {
  potential_.accept(evaluation);
  evaluation.potential.value += frame_.accept_rigid(workspace_.frame);
}

}  // namespace exmat::runtime
