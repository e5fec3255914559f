#pragma once

#include <Eigen/Core>

#include "common/core/arrays.h"
#include "common/elastic/material_model.h"
#include "common/model/reduced_model.h"
#include "runtime/kernels/aligned_array.h"
#include "runtime/sim/elasticity/reduced_elasticity.h"

namespace exmat::runtime {

/// The inverse of F* = I + H* and its determinant, 9 + 1 numbers kLanes apart, as ElementLaw takes them; the identity
/// and 0 where it is turned inside out.
void invert_target(const double* H, double* inverse) noexcept;

/// The elastic energy of a body whose undeformed shape is a target, W(q) = e sum_j c_j det F*_j Psi(F_j F*_j^-1), with
/// F_j = I + B_j q of the body and F*_j = I + G_j y of the target at the coordinates y, c_j = w_j V_j. Elements that
/// the target turns inside out, det F*_j <= 0, take no part. docs/method.md, "Force". s elements, r modes, d
/// coordinates. Immutable; no call but make_workspace() allocates or throws.
class TargetElasticity {
 public:
  struct Workspace {
    ElementPotential::Workspace elements;
    AlignedArray shifts;      ///< F* - I, see ElementLaw
    AlignedArray inverses;    ///< F*^-1 and det F*, likewise
    AlignedArray factor;      ///< e
    Eigen::VectorXd force;    ///< r
    Eigen::MatrixXd hessian;  ///< r x r
  };

  TargetElasticity() = default;

  /// Targets are given by coordinates y' with y = `coordinates` y', [d x d'].
  TargetElasticity(MaterialModel material, const TargetElasticityData& data, const RowMatrix& coordinates);

  Workspace make_workspace() const;

  Eigen::Index modes() const { return potential_.modes(); }
  Eigen::Index elements() const { return potential_.elements(); }
  Eigen::Index dimension() const { return dimension_; }  ///< d'
  const ElementPotential& potential() const { return potential_; }

  /// Takes the target y' [d'] and the factor e into the workspace; what follows is of these.
  void set_target(const Eigen::VectorXd& y, double factor, Workspace& workspace) const noexcept;

  /// W(q) [J].
  double energy(const Eigen::VectorXd& q, const Workspace& workspace) const noexcept;

  /// Adds dW/dq to `force` [r]. Returns W(q).
  double add_force(const Eigen::VectorXd& q, Workspace& workspace, Eigen::VectorXd& force) const noexcept;

  /// Adds the second derivative to the lower triangle of `hessian` [r x r].
  void add_stiffness(const Eigen::VectorXd& q, Tangent tangent, Workspace& workspace,
                     Eigen::MatrixXd& hessian) const noexcept;

 private:
  ElementLaw law(const Workspace& workspace) const noexcept;

  ElementLaw::Kind material_ = ElementLaw::Kind::kStVenantKirchhoff;
  Eigen::Index dimension_ = 0;
  ElementPotential potential_;
  WeightedLame lame_;
  AlignedArray target_gradient_;  ///< d' columns of panels x 9 x kLanes
};

}  // namespace exmat::runtime
