#pragma once

#include <Eigen/Core>
#include <vector>

#include "common/model/reduced_model.h"
#include "precompute/fem/elastic_system.h"
#include "runtime/sim/example_weights.h"
#include "runtime/sim/target.h"

namespace exmat::precompute {

/// [f x 3m] displacements that changes of descriptor stand for, by whole_body_poses() from what a bundle holds; of a
/// free body without their rigid part.
Eigen::MatrixXd example_fields(const ReducedModel& model, const ElasticSystem& system);

/// Example forces without a modal basis, of which those of method.md, section 5, are the Galerkin projection: with the
/// m eigenfunctions Phi of the shape space, T u = Lambda Phi^T (M_s/V) u / V^(1/3), and the filter P u = M Phi Phi^T
/// (M_s/V) u, U^T P U = T^+ T. f free degrees of freedom, K examples. All tets take part in the energies of the target.
class FullSpaceExamples {
 public:
  /// `fields` [f x 3m] as example_fields() has them. Tets that an example turns inside out are left out of the energies
  /// of the examples where these start from the examples. Throws InputError where the model has no examples.
  FullSpaceExamples(const ReducedModel& model, const ElasticSystem& system, const Eigen::MatrixXd& fields,
                    runtime::EnergyReference reference);

  Eigen::Index count() const { return weights_.examples(); }
  Eigen::Index left_out_tets() const { return left_out_; }

  /// [K] weights of the deformation u [f], before the bias.
  Eigen::VectorXd weights(const Eigen::VectorXd& u) const;

  /// P u and P^T u [f]; the same where density is uniform.
  Eigen::VectorXd filter(const Eigen::VectorXd& u) const;
  Eigen::VectorXd transposed_filter(const Eigen::VectorXd& u) const;
  bool symmetric() const { return symmetric_; }

  /// [f x d] mass-orthonormal basis of the poses that descriptors stand for, and [d] the examples in it.
  const Eigen::MatrixXd& pose_basis() const { return pose_basis_; }
  const Eigen::VectorXd& pose(Eigen::Index k) const { return poses_[static_cast<std::size_t>(k)]; }

  /// Minimises the energies of the examples over the tets, in coordinates y [d]: the displacement is [f x d] fields y.
  const runtime::TargetSolver& target() const { return target_; }
  const Eigen::MatrixXd& target_fields() const { return target_fields_; }

 private:
  void set_filter(const ReducedModel& model, const ElasticSystem& system);
  void set_poses(const ReducedModel& model, const ElasticSystem& system, const Eigen::MatrixXd& fields);
  void set_target(const ReducedModel& model, const ElasticSystem& system, runtime::EnergyReference reference);

  std::vector<std::int32_t> free_vertices_;
  RowMatrix analysis_;   // free vertices x m, (M_s/V) Phi
  RowMatrix synthesis_;  // free vertices x m, M Phi
  bool symmetric_ = true;
  runtime::ExampleWeights weights_;  // of Phi^T (M_s/V) u [3m]
  Eigen::MatrixXd pose_basis_, target_fields_;
  std::vector<Eigen::VectorXd> poses_;
  runtime::TargetSolver target_;
  Eigen::Index left_out_ = 0;
};

}  // namespace exmat::precompute
