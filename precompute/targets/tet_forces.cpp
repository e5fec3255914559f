#include "precompute/targets/tet_forces.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>

#include "common/elastic/materials.h"
#include "common/mesh/geometry.h"
#include "precompute/targets/example_stress.h"

namespace exmat::precompute {
namespace {

constexpr double kTolerance = 1e-9;  // of the largest example
constexpr int kMostSteps = 40;
constexpr int kMostHalvings = 5;

using Edges = Eigen::Matrix3d;

// H = sum of (u_c - u_0) (x) grad N_c.
template <typename Tet>
Eigen::Matrix3d displacement_gradient(const Eigen::VectorXd& u, const Tet& tet, const Eigen::Matrix3d& shape) {
  Edges edges;
  for (int c = 0; c < 3; ++c) edges.col(c) = u.segment<3>(3 * tet[c + 1]) - u.segment<3>(3 * tet[0]);
  return edges * shape.transpose();
}

// Its inverse, or of none where it is not positive definite: stiffness at rest is the identity.
Eigen::MatrixXd inverse_of(Eigen::MatrixXd hessian) {
  const Eigen::Index d = hessian.rows();
  const Eigen::LLT<Eigen::MatrixXd> factor(hessian);  // of the lower triangle
  if (factor.info() != Eigen::Success) return Eigen::MatrixXd::Identity(d, d);
  return factor.solve(Eigen::MatrixXd::Identity(d, d));
}

// Nocedal and Wright 2006, equation 6.17.
void update(const Eigen::VectorXd& step, const Eigen::VectorXd& change, Eigen::MatrixXd& inverse) {
  const double curvature = step.dot(change);
  if (!(curvature > 0)) return;
  const Eigen::VectorXd mapped = inverse * change;
  inverse += (1 + change.dot(mapped) / curvature) / curvature * step * step.transpose() -
             (mapped * step.transpose() + step * mapped.transpose()) / curvature;
}

}  // namespace

TetForces::TetForces(const ObjectData& object, const ElasticSystem& system, const PoseCoordinates& coordinates,
                     EnergyReference reference)
    : object_(object), reference_(reference), fields_(system.extend(coordinates.basis)) {
  const TetMesh& mesh = object.mesh;
  for (const auto& pose : coordinates.poses.colwise()) examples_.emplace_back(fields_ * pose);
  const Eigen::VectorXd volumes = tet_volumes(mesh);
  for (Eigen::Index t = 0; t < mesh.tet_count(); ++t) {
    const Eigen::Matrix3d shape = shape_gradients(tet_positions(mesh, t)).bottomRows<3>().transpose();
    const auto upright = [&](const Eigen::VectorXd& u) {
      return (Eigen::Matrix3d::Identity() + displacement_gradient(u, mesh.tets.row(t), shape)).determinant() > 0;
    };
    if (reference == EnergyReference::kExample && !std::ranges::all_of(examples_, upright)) continue;
    LameParameters lame = lame_parameters(object.materials.youngs_modulus[t], object.materials.poisson_ratio[t]);
    lame.mu *= volumes[t];
    lame.lambda *= volumes[t];
    tets_.push_back(t);
    shapes_.push_back(shape);
    lame_.push_back(lame);
  }
}

Eigen::VectorXd TetForces::force(const Eigen::VectorXd& weights, const Eigen::VectorXd& p) const {
  const Eigen::VectorXd u = fields_ * p;
  Eigen::VectorXd forces = Eigen::VectorXd::Zero(u.size());
  with_material(object_.materials.model, [&](auto material) {
    for (std::size_t i = 0; i < tets_.size(); ++i) {
      const auto tet = object_.mesh.tets.row(tets_[i]);
      const Eigen::Matrix3d H = displacement_gradient(u, tet, shapes_[i]);
      Eigen::Matrix3d P = Eigen::Matrix3d::Zero();
      for (std::size_t k = 0; k < examples_.size(); ++k)
        if (const double weight = weights[static_cast<Eigen::Index>(k)]; weight != 0)
          P += weight *
               example_stress(material, reference_, H, displacement_gradient(examples_[k], tet, shapes_[i]), lame_[i]);
      const Eigen::Matrix3d corners = P * shapes_[i];
      for (int c = 0; c < 3; ++c) {
        forces.segment<3>(3 * tet[c + 1]) += corners.col(c);
        forces.segment<3>(3 * tet[0]) -= corners.col(c);
      }
    }
  });
  return fields_.transpose() * forces;
}

TetForces::Answer TetForces::polish(const runtime::TargetSolver& solver, const Eigen::VectorXd& weights,
                                    runtime::TargetSolver::Workspace& workspace, Eigen::VectorXd& y) const {
  const RowMatrix& Z = solver.basis();
  double largest = 0;
  for (Eigen::Index k = 0; k < weights.size(); ++k) largest = std::max(largest, solver.example(k).norm());
  const auto force_at = [&](const Eigen::VectorXd& at) -> Eigen::VectorXd {
    return Z.transpose() * force(weights, Z * at);
  };
  Eigen::MatrixXd hessian = Eigen::MatrixXd::Zero(y.size(), y.size());
  solver.hessian(weights, y, workspace, hessian);
  Eigen::MatrixXd inverse = inverse_of(std::move(hessian));
  Eigen::VectorXd gradient = force_at(y);
  Answer answer{false, gradient.norm()};
  for (int taken = 0; taken < kMostSteps; ++taken) {
    answer.converged = answer.residual <= kTolerance * largest;
    if (answer.converged) break;
    Eigen::VectorXd step = -(inverse * gradient), next = force_at(y + step);
    for (int halving = 0; halving < kMostHalvings && !(next.norm() < answer.residual); ++halving) {
      step *= 0.5;
      next = force_at(y + step);
    }
    if (!(next.norm() < answer.residual)) break;
    update(step, next - gradient, inverse);
    y += step;
    gradient = next;
    answer.residual = gradient.norm();
  }
  return answer;
}

}  // namespace exmat::precompute
