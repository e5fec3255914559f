#pragma once

#include <Eigen/Core>
#include <vector>

#include "common/model/reduced_model.h"
#include "precompute/fem/elastic_system.h"
#include "precompute/full_space/full_space_model.h"
#include "tests/paper/surface_energy.h"

namespace exmat::precompute {

/// Targets of the full-space method that the paper compares with (Zhu et al. 2015, as the paper describes it): the
/// descriptor of the least weighted sum of surface energies to the examples, sum_k w_k E_k, by limited-memory BFGS,
/// each evaluation of which reconstructs the surface, x = X + N z. z [d] are descriptors in the mass-orthonormal
/// coordinates of FullSpaceExamples::pose_basis().
class SurfaceTargets : public TargetMethod {
 public:
  SurfaceTargets(const ObjectData& object, const ElasticSystem& system, const FullSpaceExamples& examples,
                 const SurfaceWeights& weights = {});

  Eigen::Index surface_vertices() const { return rest_.rows(); }

  /// sum_k w_k E_k at z and, into `gradient` [d], its derivative.
  double energy(const Eigen::VectorXd& weights, const Eigen::VectorXd& z, Eigen::VectorXd& gradient) const;

  /// Improves z; weights [K] >= 0, not all 0. Stops at a gradient of 1e-6 of the largest that an example has of
  /// another.
  Solved solve(const Eigen::VectorXd& weights, Eigen::VectorXd& z) const override;

  const Eigen::VectorXd& pose(Eigen::Index k) const { return poses_[static_cast<std::size_t>(k)]; }

 private:
  double evaluate(const SurfaceEnergy::Blend& blend, const Eigen::VectorXd& z, Eigen::VectorXd& gradient) const;
  VertexArray reconstruct(const Eigen::VectorXd& z) const;

  VertexArray rest_;        // n_s x 3
  Eigen::MatrixXd fields_;  // 3 n_s x d, N
  SurfaceEnergy energy_;
  std::vector<Eigen::VectorXd> poses_;
  std::vector<SurfaceEnergy::Shape> shapes_;
  double gradient_tolerance_ = 0;
};

/// Gives a full-space model of `object` that has examples the targets of this method.
void use_surface_targets(const ObjectData& object, FullSpaceModel& model);

}  // namespace exmat::precompute
