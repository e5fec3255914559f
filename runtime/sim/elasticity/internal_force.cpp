#include "runtime/sim/elasticity/internal_force.h"

#include <utility>

namespace exmat::runtime {

InternalForce::InternalForce(ReducedElasticity cubature, std::optional<ReducedPolynomial> polynomial)
    : cubature_(std::move(cubature)), polynomial_(std::move(polynomial)) {}

InternalForce::Workspace InternalForce::make_workspace() const {
  return {cubature_.make_workspace(), polynomial_ ? polynomial_->make_workspace() : ReducedPolynomial::Workspace{}};
}

double InternalForce::energy(const Eigen::VectorXd& q, Workspace& workspace) const noexcept {
  return polynomial_ ? polynomial_->energy(q, workspace.polynomial) : cubature_.energy(q, workspace.cubature);
}

double InternalForce::force(const Eigen::VectorXd& q, Workspace& workspace, Eigen::VectorXd& force) const noexcept {
  return polynomial_ ? polynomial_->force(q, workspace.polynomial, force)
                     : cubature_.force(q, workspace.cubature, force);
}

double InternalForce::force_and_stiffness(const Eigen::VectorXd& q, Workspace& workspace, Eigen::VectorXd& force,
                                          Eigen::MatrixXd& stiffness) const noexcept {
  return polynomial_ ? polynomial_->force_and_stiffness(q, workspace.polynomial, force, stiffness)
                     : cubature_.force_and_stiffness(q, workspace.cubature, force, stiffness);
}

void InternalForce::stiffness(const Eigen::VectorXd& q, Tangent tangent, Workspace& workspace,
                              Eigen::MatrixXd& stiffness) const noexcept {
  if (polynomial_ && tangent == Tangent::kExact)
    polynomial_->force_and_stiffness(q, workspace.polynomial, workspace.cubature.unused_force, stiffness);
  else
    cubature_.stiffness(q, tangent, workspace.cubature, stiffness);
}

double InternalForce::force_flops() const {
  return polynomial_ ? polynomial_->flops() : cubature_.potential().force_flops();
}

double InternalForce::stiffness_flops() const { return polynomial_ ? 0 : cubature_.potential().stiffness_flops(); }

double InternalForce::bytes() const {
  return polynomial_ ? polynomial_->bytes()
                     : cubature_.potential().force_bytes() + cubature_.potential().stiffness_bytes();
}

}  // namespace exmat::runtime
