#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "runtime/sim/solver/newton.h"
#include "runtime/sim/step/integrator.h"
#include "tests/support/sparse_space/sparse_model.h"

namespace exmat::precompute {

/// Displacements q [f] in the world as deformations u of the body, which damping and example forces act on: the same of
/// a clamped body, those in the FittedFrame of a free one.
class Deformation {
 public:
  Deformation(const SparseModel& model, const Eigen::VectorXd& q);

  const Eigen::VectorXd& u() const { return u_; }
  Eigen::VectorXd rate(const Eigen::VectorXd& x) const { return frame_ ? frame_->rate(*placement_, x) : x; }
  Eigen::VectorXd force(const Eigen::VectorXd& g) const { return frame_ ? frame_->force(*placement_, g) : g; }
  Eigen::VectorXd to_world(const Eigen::VectorXd& x) const {
    return frame_ ? FittedFrame::to_world(*placement_, x) : x;
  }
  Eigen::VectorXd to_frame(const Eigen::VectorXd& x) const {
    return frame_ ? FittedFrame::to_frame(*placement_, x) : x;
  }

 private:
  const FittedFrame* frame_;
  std::optional<FittedFrame::Placement> placement_;
  Eigen::VectorXd u_;
};

/// One example force of a step.
struct ExampleTerm {
  const FullSpaceExamples* examples = nullptr;
  const runtime::ExampleSettings* settings = nullptr;
  Eigen::VectorXd target;                      ///< u* [f]
  const MeshElasticity* elasticity = nullptr;  ///< elasticity of displacements from u*, for an elastic force
};

/// Terms that one step knows before its Newton iterations.
struct StepTerms {
  runtime::StepForm form;                    ///< form of the integrator in q
  Eigen::VectorXd rate_centre;               ///< u_v [f]: u' = c_v (u - u_v)
  Eigen::VectorXd external_force;            ///< [f]
  std::vector<ExampleTerm> examples;         ///< those that act; known when prepare() is called
  VertexContacts::Step* contacts = nullptr;  ///< near obstacles
};

/// Potential of one step, in d = q - q_n, which keeps the digits that c_a and a body far from its rest would take:
///   c_a/2 (q - q_a)^T M (q - q_a) + E(q) - f_ext . d + W_c(q) + c_v/2 (u - u_v)^T D (u - u_v)
///     + sum k/2 (u - u_c)^T P (u - u_c) - kappa (P u*) . u,
/// the terms of runtime::IncrementalPotential in full space, summed over the example forces; an elastic one
/// has e E*(q - u*) and of the filter the damping alone, k = c_kappa c_v. Hessians leave
/// out how the frame of a free body turns.
class StepPotential {
 public:
  StepPotential(const SparseModel& model, const FullSpaceScene& scene, const FullSpaceState& state,
                const StepTerms& terms);

  /// Elasticity at the first iterate. Returns inertia, elasticity and external force alone, comparable with
  /// potential_at_start().
  double start(const Eigen::VectorXd& d);
  double potential_at_start() const;

  /// Damping of the first iterate and all that is linear; after start() and when the target is known.
  void prepare();

  /// evaluate_first(): at the d of start(), whose elasticity serves.
  runtime::PotentialEvaluation evaluate_first(const Eigen::VectorXd& d, Eigen::VectorXd& gradient);
  runtime::PotentialEvaluation evaluate(const Eigen::VectorXd& d, Eigen::VectorXd& gradient);
  runtime::PotentialValue value(const Eigen::VectorXd& d) const;
  /// The d of the last evaluate() is the next iterate.
  void accept() { at_first_iterate_ = false; }

  /// The sparse part of the Hessian at the d of the last evaluate(), and the product with all of it. With projected
  /// tangents at the first iterate, damping is frozen anew: evaluate again.
  void assemble(const Eigen::VectorXd& d, runtime::Tangent tangent);
  LowerTriangle& hessian() { return hessian_; }
  Eigen::VectorXd product(const Eigen::VectorXd& x) const;
  /// Its part that hessian() has not, of the filters of example forces; empty where there is none.
  Eigen::VectorXd filter_product(const Eigen::VectorXd& x) const;

  double elastic_energy() const { return elastic_energy_; }

 private:
  bool deforms() const { return damped_ || filters(); }
  bool filters() const;
  double filter_stiffness(const ExampleTerm& term) const;
  double elastic_example_energy(const Eigen::VectorXd& q) const;
  double elastic_example_force(const Eigen::VectorXd& q);
  Eigen::VectorXd damping_product(const Eigen::VectorXd& u) const;
  Eigen::VectorXd filtered(const Eigen::VectorXd& u) const;
  Eigen::VectorXd deformation_product(const Eigen::VectorXd& u) const;
  double inertia_and_load(const Eigen::VectorXd& d) const;
  runtime::PotentialValue sum(double elastic, double contact, const Eigen::VectorXd& d,
                              const Eigen::VectorXd& offset_product, const Eigen::VectorXd& change) const;

  const SparseModel& model_;
  const FullSpaceScene& scene_;
  const FullSpaceState& state_;
  const StepTerms& terms_;
  bool damped_;
  double reach_;  // of the largest coordinates [m]
  bool at_first_iterate_ = true, stiffness_is_current_ = false;

  double elastic_energy_ = 0;
  Eigen::VectorXd internal_force_;
  Eigen::VectorXd example_force_;                // derivative of the elastic example energies, or empty
  LowerTriangle stiffness_, hessian_, damping_;  // damping: D, components of the world at the first iterate
  std::optional<Deformation> first_, here_;      // at the first iterate, at the last evaluate()
  Eigen::VectorXd start_deformation_;            // u_n
  Eigen::VectorXd linear_, deformation_linear_;  // gradients at q_n: of inertia and load by q, of the rest by u
};

}  // namespace exmat::precompute
