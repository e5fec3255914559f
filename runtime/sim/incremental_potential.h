#pragma once

#include <Eigen/Core>

#include "runtime/sim/newton.h"
#include "runtime/sim/workspace.h"

namespace exmat::runtime {

/// What one step minimises:
///   c_a/2 |q - q_a|^2 + c_v/2 (q - q_v)^T D (q - q_v) + E(q) - f_ext . q + k/2 (q - q_c)^T P_s (q - q_c) - kappa p* .
///   q,
/// D = alpha I + beta K(first iterate). The skew part of P_s has no potential: its force is frozen at the current
/// iterate, so that the gradient is exact and the Hessian takes the symmetric part. reduction.md, "Integration";
/// ExampleForce. Reads form, external_force and example_force of the workspace.
class IncrementalPotential {
 public:
  IncrementalPotential(const Model& model, const StepScene& scene, Workspace& workspace) noexcept;

  /// Inertia, elasticity and external force alone, given E(q).
  double without_damping(const Eigen::VectorXd& q, double elastic_energy) const noexcept;

  // For newton_minimize.
  PotentialEvaluation gradient_and_hessian(const Eigen::VectorXd& q, Eigen::VectorXd& gradient,
                                           Eigen::MatrixXd& hessian) noexcept;
  PotentialEvaluation gradient(const Eigen::VectorXd& q, Eigen::VectorXd& gradient) noexcept;
  void hessian(const Eigen::VectorXd& q, Tangent tangent, Eigen::MatrixXd& hessian) noexcept;
  PotentialValue value(const Eigen::VectorXd& q) noexcept;

  /// E at the last gradient.
  double elastic_energy() const noexcept { return elastic_energy_; }

 private:
  PotentialEvaluation assemble(const Eigen::VectorXd& q, Eigen::VectorXd& gradient) noexcept;
  PotentialValue add_damping(const Eigen::VectorXd& q, Eigen::VectorXd* gradient) noexcept;
  PotentialValue add_examples(const Eigen::VectorXd& q, Eigen::VectorXd* gradient) noexcept;
  PotentialValue sum_of_terms(const Eigen::VectorXd& q, double elastic_energy, Eigen::VectorXd* gradient) noexcept;
  void freeze_damping(const Eigen::MatrixXd& stiffness) noexcept;
  void complete_hessian(Eigen::MatrixXd& hessian) const noexcept;

  const Model& model_;
  const StepScene& scene_;
  Workspace& workspace_;
  bool examples_;
  bool at_first_iterate_ = true;
  double elastic_energy_ = 0;
};

}  // namespace exmat::runtime
