#include "runtime/sim/step/contact_problem.h"

#include <Eigen/LU>
#include <cmath>

#include "runtime/sim/frame/spin.h"

namespace exmat::runtime {

ContactProblem::ContactProblem(const Model& model, const StepScene& scene, const State& state,
                               IncrementalPotential& potential, Workspace& workspace) noexcept
    : model_(model),
      scene_(scene),
      state_(state),
      potential_(potential),
      workspace_(workspace),
      near_(*workspace.near),
      rigid_(model.rigid ? 6 : 0) {
  if (rigid_ == 0) return;
  start_rotation_ = state.body->orientation.toRotationMatrix();
  start_inertia_ = workspace.free->moments.inertia;
  expected_turn_ = workspace.free->solution.rotation;
}

/// Also q, and, of a free body, the spin, in the workspace.
BodyPose ContactProblem::place(const Eigen::VectorXd& x) noexcept {
  near_.q = state_.q + x.tail(near_.q.size());
  BodyPose pose{.q = near_.q};
  if (model_.carried) {
    pose.position = workspace_.carried->frame.position;
    pose.rotation = workspace_.carried->frame.rotation;
  }
  if (rigid_ == 0) return pose;
  const Eigen::Vector3d turn = x.segment<3>(3);
  workspace_.free->solution.rotation = turn;
  workspace_.free->solution.spin = turn / scene_.time_step;
  pose.position = model_.rigid->centre_of_mass() + workspace_.body->position + x.head<3>();
  pose.rotation = start_rotation_ * rotation_of(turn);
  return pose;
}

PotentialEvaluation ContactProblem::evaluate(const Eigen::VectorXd& x, Eigen::VectorXd& gradient,
                                             Eigen::MatrixXd& hessian) noexcept {
  const BodyPose pose = place(x);
  PotentialEvaluation inner = potential_.evaluate(near_.q, near_.gradient_q, workspace_.newton.hessian);
  model_.contact->evaluate(pose, near_.contact);
  PotentialEvaluation evaluation = finish(x, inner, gradient);
  frozen_turn_ = next_frozen_turn_;
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
  const double added = contact.potential + add_rigid_terms(x, &gradient);
  evaluation.potential.value += added;
  evaluation.potential.magnitude += std::abs(added);
  evaluation.force_scale += contact.generalised.norm();
  if (rigid_ > 0) evaluation.force_scale += contact.force.norm() / std::sqrt(model_.rigid->mass());
  return evaluation;
}

PotentialValue ContactProblem::value(const Eigen::VectorXd& x) noexcept {
  const BodyPose pose = place(x);
  PotentialValue value = potential_.value(near_.q);
  const double added = model_.contact->potential(pose, near_.contact) + add_rigid_terms(x, nullptr);
  value.value += added;
  value.magnitude += std::abs(added);
  return value;
}

/// Inertia of d and t. That of t is exact in the gradient, a quadratic form and a frozen rest in the value.
double ContactProblem::add_rigid_terms(const Eigen::VectorXd& x, Eigen::VectorXd* gradient) noexcept {
  if (rigid_ == 0) return 0;
  const double dt = scene_.time_step, mass = model_.rigid->mass();
  const Eigen::Vector3d d = x.head<3>(), t = x.segment<3>(3);
  const Eigen::Vector3d quadratic = start_inertia_ * (t - expected_turn_) / (dt * dt);
  const double value =
      0.5 * mass / (dt * dt) * d.squaredNorm() + 0.5 * (t - expected_turn_).dot(quadratic) + frozen_turn_.dot(t);
  if (gradient == nullptr) return value;
  const FreeMotionWorkspace& free = *workspace_.free;
  const Eigen::Matrix3d turn = rotation_of(t);
  const Eigen::Vector3d momentum =
      free.moments.inertia * free.solution.spin + free.moments.deformation.transpose() * free.velocity;
  const Eigen::Matrix3d to_turn = right_jacobian(t).transpose();
  const Eigen::Vector3d inertia = to_turn * ((momentum - turn.transpose() * free.problem.momentum) / dt);
  next_frozen_turn_ = inertia - quadratic;
  gradient->head<3>() = mass / (dt * dt) * d - near_.contact.force;
  gradient->segment<3>(3) =
      inertia - to_turn * (turn.transpose() * (start_rotation_.transpose() * near_.contact.torque));
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
  near_.stiffness.setZero();
  if (rigid_ == 0) {
    model_.contact->add_reduced_stiffness(pose, near_.contact, hessian);
    return;
  }
  const double dt = scene_.time_step;
  const FreeMotionWorkspace& free = *workspace_.free;
  model_.contact->add_stiffness(pose, near_.contact, near_.stiffness);
  // The contacts turn about world axes, the unknown t is a rotation vector.
  const Eigen::Matrix3d to_world = pose.rotation * right_jacobian(x.segment<3>(3));
  Eigen::MatrixXd& K = near_.stiffness;
  K.triangularView<Eigen::StrictlyUpper>() = K.transpose();
  for (Eigen::Index i = 0; i < K.rows(); ++i) {
    const Eigen::RowVector3d row = K.block<1, 3>(i, 3) * to_world;
    K.block<1, 3>(i, 3) = row;
  }
  for (Eigen::Index j = 0; j < K.cols(); ++j) {
    const Eigen::Vector3d column = to_world.transpose() * K.block<3, 1>(3, j);
    K.block<3, 1>(3, j) = column;
  }
  hessian.triangularView<Eigen::Lower>() += K;
  hessian.diagonal().head<3>().array() += model_.rigid->mass() / (dt * dt);
  hessian.block<3, 3>(3, 3).triangularView<Eigen::Lower>() += free.moments.inertia / (dt * dt);
  hessian.block(6, 3, modes, 3) += free.moments.deformation / (dt * dt);
}

void ContactProblem::accept(PotentialEvaluation& evaluation) noexcept {
  potential_.accept(evaluation);
  if (rigid_ == 0) return;
  evaluation.potential.value += (next_frozen_turn_ - frozen_turn_).dot(workspace_.free->solution.rotation);
  frozen_turn_ = next_frozen_turn_;
}

}  // namespace exmat::runtime
