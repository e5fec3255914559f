#include "runtime/sim/step/attached_problem.h"

namespace exmat::runtime {
AttachedProblem::AttachedProblem(const Model& model, const State& state, IncrementalPotential& potential,
                                 Workspace& workspace) noexcept
    : frame_(*model.frame),
      state_(state),
      near_(*workspace.near),
      held_(near_.held),
      problem_(model, state, potential, workspace) {}

bool AttachedProblem::begin(Eigen::VectorXd& x, NewtonReport& report) noexcept {
  NewtonWorkspace& newton = near_.newton;
  problem_.evaluate(x, newton.gradient, newton.hessian);
  if (held_.conditions() > 0) set_conditions(x);
  if (!detail::factorise(*this, newton, report)) {
    ++report.projections;
    problem_.hessian(x, Tangent::kPositiveSemidefinite, newton.hessian);
    if (!detail::factorise_shifted(*this, newton, report)) return false;
  }
  return hold(x) && x.allFinite();
}

/// Returns how far the body is from the origin [m].
double AttachedProblem::set_conditions(const Eigen::VectorXd& x) noexcept {
  const BodyPose pose = problem_.place(x);
  runtime::set_conditions(state_.attachments, frame_, x, pose, held_);
  return pose.position.norm();
}

/// To the conditions, and J and the factor of J A^-1 J_f^T there, J_f that of the last factorisation.
bool AttachedProblem::hold(Eigen::VectorXd& x) noexcept {
  return held_.conditions() == 0 ||
         held_.hold(x, [this](const Eigen::VectorXd& there) { return set_conditions(there); });
}

void AttachedProblem::finish(PotentialEvaluation& evaluation, const Eigen::VectorXd& x,
                             Eigen::VectorXd& gradient) noexcept {
  if (held_.conditions() == 0) return;
  held_.subtract_forces(gradient);
  add_condition_forces(state_.attachments, problem_.place(x), held_);
  const Eigen::Index modes = near_.q.size();
  evaluation.force_scale +=
      frame_.residual_of(held_.sums.force) + held_.gradients().bottomRows(modes).lazyProduct(held_.multipliers).norm();
}

PotentialEvaluation AttachedProblem::evaluate(Eigen::VectorXd& x, Eigen::VectorXd& gradient,
                                              Eigen::MatrixXd& hessian) noexcept {
  const bool held = hold(x);
  PotentialEvaluation evaluation = problem_.evaluate(x, gradient, hessian);
  finish(evaluation, x, gradient);
  if (!held) evaluation.potential.value = kNowhere;
  return evaluation;
}

PotentialEvaluation AttachedProblem::evaluate(Eigen::VectorXd& x, Eigen::VectorXd& gradient) noexcept {
  const bool held = hold(x);
  PotentialEvaluation evaluation = problem_.evaluate(x, gradient);
  finish(evaluation, x, gradient);
  if (!held) evaluation.potential.value = kNowhere;
  return evaluation;
}

PotentialValue AttachedProblem::value(Eigen::VectorXd& x) noexcept {
  return hold(x) ? problem_.value(x) : PotentialValue{kNowhere, 0};
}

void AttachedProblem::hessian(const Eigen::VectorXd& x, Tangent tangent, Eigen::MatrixXd& hessian) noexcept {
  problem_.hessian(x, tangent, hessian);
  if (held_.conditions() > 0) set_conditions(x);
}

bool AttachedProblem::factorise() noexcept {
  NewtonWorkspace& newton = near_.newton;
  const Eigen::Index size = newton.hessian.rows();
  if (!kernels().cholesky(newton.hessian.data(), size, newton.hessian.outerStride(), newton.factor.data()))
    return false;
  Eigen::Map<Eigen::VectorXd> column(newton.direction.data(), size);
  for (Eigen::Index k = 0; k < held_.conditions(); ++k) {
    column = held_.gradients().col(k);
    kernels().cholesky_solve(newton.factor.data(), size, newton.direction.data());
    held_.directions().col(k) = column;
  }
  if (held_.conditions() > 0) held_.factorise();
  return true;
}

void AttachedProblem::solve(Eigen::Map<Eigen::VectorXd>& x) noexcept {
  kernels().cholesky_solve(near_.newton.factor.data(), x.size(), x.data());
  if (held_.conditions() > 0) held_.make_tangent(x);
}

namespace {

bool is_hard(const Attachment& attachment) noexcept { return attachment.holds() && attachment.conditions() > 0; }

/// The centre of mass goes exactly as the conditions have it, and the momentum with it: the residual of Newton's method
/// in its force goes to the first attachment that is hard.
void settle_force(const BodyFrame& frame, std::span<const Attachment> attachments, const BodyPose& pose,
                  const FrameWorkspace& workspace, ContactProblemWorkspace& near) noexcept {
  if (frame.rigid_unknowns() == 0) return;
  const Eigen::Vector3d lacking = frame.force_of(near.x, workspace) - near.contact.force - near.held.sums.force;
  add_hard_force(attachments, pose, lacking, near.held);
}

}  // namespace

bool holds_hard(std::span<const Attachment> attachments) noexcept { return std::ranges::any_of(attachments, is_hard); }

void add_hard_force(std::span<const Attachment> attachments, const BodyPose& pose, const Eigen::Vector3d& force,
                    AttachmentWorkspace& workspace) noexcept {
  const auto first = std::ranges::find_if(attachments, is_hard);
  if (first == attachments.end()) return;
  workspace.forces.col(first - attachments.begin()) += force;
  workspace.sums.force += force;
  workspace.sums.torque += (mean_of(*first, pose) - pose.position).cross(force);
}

NewtonReport solve_attached(const Model& model, const StepScene& scene, const State& state,
                            IncrementalPotential& potential, Workspace& workspace) noexcept {
  ContactProblemWorkspace& near = *workspace.near;
  start_contact(model, scene, state, workspace);
  near.newton.profile = workspace.profile;
  AttachedProblem problem(model, state, potential, workspace);
  NewtonReport total;
  if (!problem.begin(near.x, total)) {
    total.status = NewtonStatus::kNonFinite;
    return total;
  }
  add(minimise_near(problem, model, scene, state, potential, workspace, NewtonBegin::kFactor), total);
  if (total.status == NewtonStatus::kNonFinite) return total;
  const BodyPose pose{model.frame->place(near.x, workspace.frame), near.q};
  settle_force(*model.frame, state.attachments, pose, workspace.frame, near);
  finish_contact(model, state, total.status == NewtonStatus::kConverged, near.contact.torque, workspace);
  return total;
}

}  // namespace exmat::runtime
