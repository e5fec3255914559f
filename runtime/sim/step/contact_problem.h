#pragma once

#include <Eigen/Core>

#include "runtime/sim/contact/contact.h"
#include "runtime/sim/step/incremental_potential.h"

namespace exmat::runtime {

/// A step near obstacles, by backward Euler, or of a body that a host holds: IncrementalPotential and the potential of
/// the contacts and of the host's springs in the unknowns
///   d   displacement of the centre of mass beyond what external forces make of it [m],
///   t   rotation of the step, R = R_n exp([t]x) [rad],
///   y   q - q_n,
/// d and t of a free body alone. docs/step_in_detail.md, "Contact": mass [[m I, 0, 0], [0, J, H], [0, H^T, I]], contact
/// Jacobians [I, -[x - c]x, R U_i]. Momenta follow from the forces of the solution, so what the contacts take is
/// exactly what the body loses. For newton_minimise.
class ContactProblem {
 public:
  /// Beyond the place where a contact begins the first length that is low enough may lie far up the other side.
  static constexpr bool kSeeksLowest = true;

  /// `potential` after start() and prepare(); candidates gathered and frozen in workspace.near.
  ContactProblem(const Model& model, const State& state, IncrementalPotential& potential,
                 Workspace& workspace) noexcept;

  PotentialEvaluation evaluate(const Eigen::VectorXd& x, Eigen::VectorXd& gradient, Eigen::MatrixXd& hessian) noexcept;
  PotentialEvaluation evaluate(const Eigen::VectorXd& x, Eigen::VectorXd& gradient) noexcept;
  PotentialValue value(const Eigen::VectorXd& x) noexcept;
  void hessian(const Eigen::VectorXd& x, Tangent tangent, Eigen::MatrixXd& hessian) noexcept;
  void accept(PotentialEvaluation& evaluation) noexcept;
  const Eigen::MatrixXd* gyroscopic() const noexcept { return nullptr; }  // backward Euler damps what it is for

  /// Pose at the unknowns x.
  BodyPose place(const Eigen::VectorXd& x) noexcept;

  // The same in parts: between them others add what they do to this body, to the sums and the stiffness in
  // workspace.near.

  /// Evaluates the body, its obstacles and springs at x; sums of the contacts in workspace.near->contact, of the
  /// springs in workspace.near->held. `first`: with the elastic Hessian of the potential's start().
  PotentialEvaluation evaluate_alone(const Eigen::VectorXd& x, bool first) noexcept;
  /// Obstacles and springs alone at a pose: the sums.
  void evaluate_outside(const BodyPose& pose) noexcept;
  /// `alone` and its gradient in workspace.near->gradient_q, with what outside and a rigid motion add.
  PotentialEvaluation finish(const Eigen::VectorXd& x, const PotentialEvaluation& alone,
                             Eigen::VectorXd& gradient) noexcept;
  /// The elastic Hessian at a pose, into workspace.newton.
  void evaluate_elastic_hessian(const BodyPose& pose, Tangent tangent) noexcept;
  /// The stiffness of obstacles and springs, alone in workspace.near->stiffness.
  void start_stiffness(const BodyPose& pose) noexcept;
  /// Lower triangle of the sum of both and of inertia.
  void finish_hessian(const BodyPose& pose, const Eigen::VectorXd& x, Eigen::MatrixXd& hessian) noexcept;

 private:
  const Model& model_;
  const BodyFrame& frame_;
  const State& state_;
  IncrementalPotential& potential_;
  Workspace& workspace_;
  ContactProblemWorkspace& near_;
};

}  // namespace exmat::runtime
