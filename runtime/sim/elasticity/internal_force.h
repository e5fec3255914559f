#pragma once

#include <Eigen/Core>
#include <optional>

#include "runtime/sim/elasticity/reduced_elasticity.h"
#include "runtime/sim/elasticity/reduced_polynomial.h"

namespace exmat::runtime {

/// Elasticity of a reduced body, by the exact polynomial where there is one, else by cubature. Immutable; no call
/// allocates or throws.
class InternalForce {
 public:
  struct Workspace {
    ReducedElasticity::Workspace cubature;
    ReducedPolynomial::Workspace polynomial;
  };

  InternalForce() = default;
  InternalForce(ReducedElasticity cubature, std::optional<ReducedPolynomial> polynomial);

  Workspace make_workspace() const;

  Eigen::Index modes() const { return cubature_.modes(); }
  const ReducedElasticity& cubature() const { return cubature_; }
  const std::optional<ReducedPolynomial>& polynomial() const { return polynomial_; }

  /// As ReducedElasticity. Positive semi-definite tangents are those of the cubature elements in either case.
  double energy(const Eigen::VectorXd& q, Workspace& workspace) const noexcept;
  double force(const Eigen::VectorXd& q, Workspace& workspace, Eigen::VectorXd& force) const noexcept;
  double force_and_stiffness(const Eigen::VectorXd& q, Workspace& workspace, Eigen::VectorXd& force,
                             Eigen::MatrixXd& stiffness) const noexcept;
  void stiffness(const Eigen::VectorXd& q, Tangent tangent, Workspace& workspace,
                 Eigen::MatrixXd& stiffness) const noexcept;

  /// Floating-point operations and bytes of constant arrays of one evaluation.
  double force_flops() const;
  double stiffness_flops() const;  ///< in addition to force_flops()
  double bytes() const;            ///< force and stiffness together

 private:
  ReducedElasticity cubature_;
  std::optional<ReducedPolynomial> polynomial_;
};

}  // namespace exmat::runtime
