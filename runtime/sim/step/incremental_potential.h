#pragma once

#include <Eigen/Core>
#include <limits>

#include "runtime/sim/solver/newton.h"
#include "runtime/sim/step/state.h"
#include "runtime/sim/step/workspace.h"

namespace exmat::runtime {

/// Potential that one step minimises:
///   c_a/2 |q - q_a|^2 + c_v/2 (q - q_v)^T D (q - q_v) + E(q) - f_ext . q
///   + sum over the example forces of k/2 (q - q_c)^T P_s (q - q_c) - kappa g . q, or of k/2 ... + W(q) with k =
///   c_kappa c_v where they are elastic,
/// D = alpha I + beta K(first iterate), up to a constant. All but E and W is one quadratic form of the step's
/// displacement q - q_n, prepared once: an evaluation costs these and one product with a matrix. The forces of the
/// frame (BodyFrame::force()) have no potential: in values they are those of the iterate last accepted, so that the
/// gradient is exact. docs/step_in_detail.md, "The incremental potential"; ExampleForce. Reads form and external_force
/// of the workspace.
class IncrementalPotential {
 public:
  IncrementalPotential(const Model& model, const StepScene& scene, const State& state, Workspace& workspace) noexcept;

  /// Elasticity of the first iterate, force and stiffness, into the workspace. Returns inertia, elasticity and external
  /// force alone; comparable with potential_at_start().
  double start(const Eigen::VectorXd& first_iterate) noexcept;
  double potential_at_start() const noexcept;
  /// Value of start() alone, but for rounding.
  double potential_of_start(const Eigen::VectorXd& first_iterate) noexcept;

  /// The quadratic form. After start(); with example forces, after prepare_example_forces().
  void prepare() noexcept;

  // For newton_minimise; the first evaluation with a Hessian is of the first iterate.
  PotentialEvaluation evaluate(const Eigen::VectorXd& q, Eigen::VectorXd& gradient, Eigen::MatrixXd& hessian) noexcept;
  PotentialEvaluation evaluate(const Eigen::VectorXd& q, Eigen::VectorXd& gradient) noexcept;
  PotentialValue value(const Eigen::VectorXd& q) noexcept;
  void hessian(const Eigen::VectorXd& q, Tangent tangent, Eigen::MatrixXd& hessian) noexcept;
  void accept(PotentialEvaluation& evaluation) noexcept;
  const Eigen::MatrixXd* gyroscopic() const noexcept;
  int gyroscopic_terms() const noexcept;
  /// True if an antisymmetric part of that ratio to inertia is weak: then so many terms of a series serve.
  static bool is_weak(double ratio) noexcept;
  static int gyroscopic_terms(double ratio) noexcept;
  const Eigen::VectorXd& gyroscopic_product(const Eigen::VectorXd& x) const noexcept;

  /// E at the last evaluate() or start().
  double elastic_energy() const noexcept { return elastic_energy_; }
  /// Sets E of a solution that was found elsewhere.
  void set_elastic_energy(double energy) noexcept { elastic_energy_ = energy; }

  /// Relative, of internal forces over trace(K) |q|.
  static constexpr double kForceRounding = 4 * std::numeric_limits<double>::epsilon();

  double tolerance() const noexcept { return scene_.newton.tolerance; }
  StepRate rate() const noexcept { return {workspace_.form.velocity_factor, scene_.time_step}; }

 private:
  void set_offset(const Eigen::VectorXd& q) noexcept;
  double inertia_and_load(const Eigen::VectorXd& q) const noexcept;
  PotentialEvaluation assemble(const Eigen::VectorXd& q, Eigen::VectorXd& gradient) noexcept;
  bool update_frozen_force(const Eigen::VectorXd& q) noexcept;
  PotentialValue quadratic(double elastic_energy) noexcept;
  void add_example_forces() noexcept;
  void add_quadratic(Eigen::MatrixXd& hessian) const noexcept;
  double internal_flops(bool stiffness) const noexcept;

  const Model& model_;
  const StepScene& scene_;
  const State& state_;
  Workspace& workspace_;
  bool frame_forces_;
  double elastic_examples_ = 0;  // sum of their factors
  bool at_first_iterate_ = true;
  double elastic_energy_ = 0;
  double force_rounding_ = 0;  // of internal forces over |q|
};

}  // namespace exmat::runtime
