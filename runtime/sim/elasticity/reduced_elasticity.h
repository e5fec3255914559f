#pragma once

#include <Eigen/Core>
#include <memory>
#include <vector>

#include "common/core/arrays.h"
#include "common/elastic/material.h"
#include "common/elastic/material_model.h"
#include "common/model/reduced_model.h"
#include "runtime/sim/elasticity/constant_stiffness.h"
#include "runtime/sim/elasticity/element_potential.h"
#include "runtime/sim/elasticity/stiffness_polynomial.h"

namespace exmat::runtime {

/// [s] Lame parameters of the cubature elements.
std::vector<LameParameters> cubature_lame(const CubatureData& cubature);

/// c_j mu_j and c_j lambda_j [N m], s each, c_j = w_j V_j.
struct WeightedLame {
  AlignedArray mu, lambda;

  WeightedLame() = default;
  WeightedLame(const Eigen::VectorXd& weighted_volumes, const std::vector<LameParameters>& lame);
};

/// Elasticity of a reduced body by cubature: E(q) = sum_j c_j Psi(I + B_j q) + 1/2 q^T V q, c_j = w_j V_j, V the
/// variance term of smoothed elements. docs/step_in_detail.md, "Internal force". s elements, r coordinates. Immutable;
/// all scratch is the caller's, no call but prepare_lanes() allocates or throws.
class ReducedElasticity {
 public:
  using Workspace = ElementPotential::Workspace;

  ReducedElasticity() = default;

  /// `gradient` [9s x r] is B, `weighted_volumes` [s] the c_j [m^3], `lame` [s], `variance` [r x r] V, or without
  /// entries.
  ReducedElasticity(MaterialModel material, const RowMatrix& gradient, const Eigen::VectorXd& weighted_volumes,
                    const std::vector<LameParameters>& lame, const RowMatrix& variance = {});

  explicit ReducedElasticity(MaterialModel material, const CubatureData& cubature);

  Workspace make_workspace() const { return potential_.make_workspace(); }

  Eigen::Index modes() const { return potential_.modes(); }
  Eigen::Index elements() const { return potential_.elements(); }
  const ElementPotential& potential() const { return potential_; }

  /// E(q) [J], q [r].
  double energy(const Eigen::VectorXd& q, Workspace& workspace) const noexcept {
    return potential_.energy(law(), q) + variance_.energy(q, workspace.constant.data());
  }

  /// `force` [r] = dE/dq = sum_j c_j B_j^T P_j + V q. Returns E(q).
  double force(const Eigen::VectorXd& q, Workspace& workspace, Eigen::VectorXd& force) const noexcept {
    const double energy = potential_.force(law(), q, workspace, force);
    return energy + variance_.add_force(q, workspace.constant.data(), force);
  }

  /// Lower triangle of `stiffness` [r x r] = sum_j c_j B_j^T (dP/dF)_j B_j + V; the upper one is left as it was.
  void stiffness(const Eigen::VectorXd& q, Tangent tangent, Workspace& workspace,
                 Eigen::MatrixXd& stiffness) const noexcept {
    potential_.stiffness(law(), q, tangent, workspace, stiffness);
    variance_.add_stiffness(stiffness);
  }

  /// force() and the exact stiffness() in one pass. Returns E(q).
  double force_and_stiffness(const Eigen::VectorXd& q, Workspace& workspace, Eigen::VectorXd& force,
                             Eigen::MatrixXd& stiffness) const noexcept {
    const double energy = potential_.force_and_stiffness(law(), q, workspace, force, stiffness);
    variance_.add_stiffness(stiffness);
    return energy + variance_.add_force(q, workspace.constant.data(), force);
  }

  /// Makes what only bodies side by side take, unless a call has done so; threads may call it at once.
  void prepare_lanes() const;

  /// After that the same of kLanes bodies side by side (kernels.h): energies [kLanes], q, scratch and forces
  /// [r x kLanes], stiffness of lane_triangle(r) doubles.
  void lanes_energy(const double* q, double* scratch, double* energy) const noexcept {
    potential_.lanes_energy(law(), q, energy);
    variance_.add_lanes_energy(q, scratch, energy);
  }
  void lanes_force(const double* q, double* scratch, double* energy, double* force) const noexcept {
    potential_.lanes_force(law(), q, energy, force);
    variance_.add_lanes_force(q, scratch, energy, force);
  }
  void lanes_force_and_stiffness(const double* q, Precision precision, double* scratch, double* energy, double* force,
                                 double* stiffness) const noexcept;
  /// Floating-point operations of that stiffness, of one body.
  double lanes_stiffness_flops() const noexcept;

 private:
  ElementLaw law() const noexcept;

  ElementLaw::Kind kind_ = ElementLaw::Kind::kStVenantKirchhoff;
  ElementPotential potential_;
  WeightedLame lame_;
  ConstantStiffness variance_;
  std::shared_ptr<LazyStiffnessPolynomial> polynomial_;  ///< null where the elements take less; shared by copies
};

}  // namespace exmat::runtime
