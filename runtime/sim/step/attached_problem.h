#pragma once

#include "runtime/sim/step/contact_problem.h"
#include "runtime/sim/step/contact_step.h"

namespace exmat::runtime {

/// The step of a body in its modes that a host holds: ContactProblem, whose springs are the host's too, under the
/// Conditions of fixed patches and balls at the end of the step, with the last Hessian that was factorised as their A.
/// The multipliers of the solution are the forces of the attachments. The curvature of C is left out of the Hessian: it
/// is to inertia as (turn of a step)^2. docs/step_in_detail.md, "Attachments". For newton_minimise.
class AttachedProblem {
 public:
  static constexpr bool kSeeksLowest = ContactProblem::kSeeksLowest;

  /// As ContactProblem, and scratch for the state's attachments in workspace.near.
  AttachedProblem(const Model& model, const State& state, IncrementalPotential& potential,
                  Workspace& workspace) noexcept;

  /// The Hessian at the first iterate `x`, factorised, and x where the conditions hold. False where numbers are not
  /// finite.
  bool begin(Eigen::VectorXd& x, NewtonReport& report) noexcept;

  PotentialEvaluation evaluate(Eigen::VectorXd& x, Eigen::VectorXd& gradient, Eigen::MatrixXd& hessian) noexcept;
  PotentialEvaluation evaluate(Eigen::VectorXd& x, Eigen::VectorXd& gradient) noexcept;
  PotentialValue value(Eigen::VectorXd& x) noexcept;
  void hessian(const Eigen::VectorXd& x, Tangent tangent, Eigen::MatrixXd& hessian) noexcept;
  void accept(PotentialEvaluation& evaluation) noexcept { problem_.accept(evaluation); }
  const Eigen::MatrixXd* gyroscopic() const noexcept { return nullptr; }
  bool factorise() noexcept;
  void shift(double share) noexcept { shift_diagonal(share, near_.newton.hessian); }
  void solve(Eigen::Map<Eigen::VectorXd>& x) noexcept;

 private:
  bool hold(Eigen::VectorXd& x) noexcept;
  double set_conditions(const Eigen::VectorXd& x) noexcept;
  void finish(PotentialEvaluation& evaluation, const Eigen::VectorXd& x, Eigen::VectorXd& gradient) noexcept;

  const BodyFrame& frame_;
  const State& state_;
  ContactProblemWorkspace& near_;
  AttachmentWorkspace& held_;
  ContactProblem problem_;
};

/// True if a frame holds the body by conditions.
bool holds_hard(std::span<const Attachment> attachments) noexcept;

/// Adds to the force of the first frame that holds the body so, if one does [N].
void add_hard_force(std::span<const Attachment> attachments, const BodyPose& pose, const Eigen::Vector3d& force,
                    AttachmentWorkspace& workspace) noexcept;

/// Newton's method of the step of a body that a host holds, from workspace.q; likewise solve_with_contacts().
NewtonReport solve_attached(const Model& model, const StepScene& scene, const State& state,
                            IncrementalPotential& potential, Workspace& workspace) noexcept;

}  // namespace exmat::runtime
