#pragma once

#include <Eigen/Core>

#include "precompute/fem/elastic_system.h"
#include "precompute/shape_space/laplace_basis.h"
#include "precompute/shape_space/region_view.h"
#include "precompute/solvers/semidefinite_solver.h"

namespace exmat::precompute {

/// kappa of a region's poses relative to the squared frequency of the highest linear mode: forces of scenes rarely
/// exceed it.
inline constexpr double kRegionStiffness = 100;

/// Poses of the whole body that a region's changes of descriptor stand for: the displacement w that minimises
/// kappa M_b |b w - c|^2 + w^T K w, where b w are the coefficients of what the view sees of it, c those of the change
/// and M_b the mass of the body. That is where the body comes to rest, at small displacements, under an example force
/// of stiffness kappa in the region: close to the example there, whatever elasticity makes of it outside, and torn
/// nowhere. docs/method.md, section 5.5.
class RegionPoses {
 public:
  /// `weights` is Lambda [m]; `solver` is that of the system's stiffness; `stiffness` kappa > 0 [1/s^2]. 3m solves.
  RegionPoses(const LaplaceBasis& object, const Eigen::VectorXd& weights, const RegionView& view,
              const ElasticSystem& system, const SemidefiniteSolver& solver, double stiffness);

  /// [f x k] free rows of w for changes of descriptor [3m x k], entry 3i + axis.
  Eigen::MatrixXd displacements(const Eigen::MatrixXd& changes) const;

 private:
  Eigen::MatrixXd poses_;  // f x 3m, of unit changes
};

}  // namespace exmat::precompute
