#include "precompute/shape_space/region_poses.h"

#include <cmath>

#include "common/core/decompositions.h"

namespace exmat::precompute {

RegionPoses::RegionPoses(const LaplaceBasis& object, const Eigen::VectorXd& weights, const RegionView& view,
                         const ElasticSystem& system, const SemidefiniteSolver& solver, double stiffness) {
  const Eigen::Index n = object.vertices.rows(), m = weights.size();
  const Eigen::MatrixXd functions = object.mass * object.eigenfunctions;
  Eigen::MatrixXd loads = Eigen::MatrixXd::Zero(3 * n, 3 * m);  // b^T
  for (int axis = 0; axis < 3; ++axis) loads(Eigen::seqN(axis, n, 3), Eigen::seqN(axis, m, 3)) = functions;
  loads = system.restrict(view.transposed(loads));
  const Eigen::MatrixXd responses = solver.solve(loads);
  const Eigen::VectorXd along = Eigen::VectorXd::Ones(n).replicate(1, 3).transpose().reshaped() / std::sqrt(3.0);
  const double mass = along.dot(system.full_mass * along);
  Eigen::MatrixXd compliance = loads.transpose() * responses;
  compliance.diagonal().array() += 1 / (stiffness * mass);
  const Eigen::VectorXd scales =
      (std::cbrt(object.volume) * weights.cwiseInverse()).replicate(1, 3).transpose().reshaped();
  poses_ = responses * compliance.ldlt().solve(Eigen::MatrixXd(scales.asDiagonal()));
}

Eigen::MatrixXd RegionPoses::displacements(const Eigen::MatrixXd& changes) const { return poses_ * changes; }

}  // namespace exmat::precompute
