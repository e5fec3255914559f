#pragma once

#include <Eigen/Core>
#include <optional>
#include <string_view>
#include <vector>

#include "common/core/arrays.h"
#include "common/elastic/material.h"
#include "common/model/reduced_model.h"

namespace exmat::runtime {

enum class Material { kStVenantKirchhoff };

/// "stvk"; nothing for a name that this version does not know.
std::optional<Material> material_from_name(std::string_view name);

/// [s] Lame parameters of the cubature elements.
std::vector<LameParameters> cubature_lame(const CubatureData& cubature);

/// Which tangent dP/dF a stiffness is built of.
enum class Tangent {
  kExact,
  kPositiveSemidefinite,  ///< negative eigenvalues of every element's 9 x 9 tangent set to zero
};

/// Elasticity of a reduced body by cubature: E(q) = sum_j c_j Psi(I + B_j q), c_j = w_j V_j. method.md, section 6.
/// s elements, r coordinates. Immutable; all scratch is the caller's, no call allocates or throws.
class ReducedElasticity {
 public:
  /// Sized once by make_workspace(); any ReducedElasticity of the same s and r may share it.
  struct Workspace {
    Eigen::VectorXd displacement_gradients;  ///< 9s, H = F - I of every element
    Eigen::VectorXd stresses;                ///< 9s, c_j P_j
    RowMatrix tangent_gradients;             ///< c_j dP/dF B_j of one batch of elements
  };

  ReducedElasticity() = default;

  /// `gradient` [9s x r] is B, `weighted_volumes` [s] the c_j [m^3], `lame` [s].
  ReducedElasticity(Material material, RowMatrix gradient, Eigen::VectorXd weighted_volumes,
                    std::vector<LameParameters> lame);

  Workspace make_workspace() const;

  Eigen::Index modes() const { return gradient_.cols(); }
  Eigen::Index elements() const { return weighted_volumes_.size(); }

  /// E(q) [J], q [r].
  double energy(const Eigen::VectorXd& q, Workspace& workspace) const noexcept;

  /// `force` [r] = dE/dq = sum_j c_j B_j^T P_j. Returns E(q).
  double force(const Eigen::VectorXd& q, Workspace& workspace, Eigen::VectorXd& force) const noexcept;

  /// Lower triangle of `stiffness` [r x r] = sum_j c_j B_j^T (dP/dF)_j B_j; the upper one is left as it was.
  void stiffness(const Eigen::VectorXd& q, Tangent tangent, Workspace& workspace,
                 Eigen::MatrixXd& stiffness) const noexcept;

  /// force() and the exact stiffness() in one pass. Returns E(q).
  double force_and_stiffness(const Eigen::VectorXd& q, Workspace& workspace, Eigen::VectorXd& force,
                             Eigen::MatrixXd& stiffness) const noexcept;

 private:
  void displacement_gradients(const Eigen::VectorXd& q, Workspace& workspace) const noexcept;
  double force_at_gradients(Workspace& workspace, Eigen::VectorXd& force) const noexcept;
  void stiffness_at_gradients(Tangent tangent, Workspace& workspace, Eigen::MatrixXd& stiffness) const noexcept;

  Material material_ = Material::kStVenantKirchhoff;
  RowMatrix gradient_;                ///< 9s x r
  Eigen::VectorXd weighted_volumes_;  ///< s
  std::vector<LameParameters> lame_;  ///< s
  Eigen::Index batch_ = 0;            ///< elements per product of the stiffness
};

}  // namespace exmat::runtime
