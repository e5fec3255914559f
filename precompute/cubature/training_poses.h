#pragma once

#include <cstdint>

#include "precompute/fem/elastic_system.h"
#include "precompute/modes/linear_modes.h"

namespace exmat::precompute {

/// Data that reduced poses are drawn from.
struct PoseSource {
  Eigen::VectorXd eigenvalues;          ///< k, of the modes in use
  Eigen::MatrixXd reduced_modes;        ///< r x k, U^T M Psi
  Eigen::MatrixXd reduced_derivatives;  ///< r x k(k+1)/2, U^T M phi_ij, columns as pair_index
  RowMatrix basis;                      ///< 3n x r
  Eigen::MatrixXd rest_stiffness;       ///< r x r, U^T K U
  double body_size = 0;                 ///< L [m]
  Eigen::MatrixXd examples;             ///< r x (K-1) reduced poses of the examples but the rest one, or no columns
  Eigen::MatrixXd motions;              ///< r x N, reduced, of runs, or no columns
  Eigen::Index own_motions = 0;         ///< number of columns of `motions` that come first and count for half
  Eigen::MatrixXd other_motions;        ///< r x N, of other runs, for held-out poses
};

/// Members that the stage cache keeps.
template <typename Archive>
void pass_members(Archive& archive, PoseSource& value) {
  pass_all(archive, value.eigenvalues, value.reduced_modes, value.reduced_derivatives, value.basis,
           value.rest_stiffness, value.body_size, value.examples, value.motions, value.own_motions,
           value.other_motions);
}

/// The number of linear modes that poses are drawn from.
constexpr Eigen::Index kTrainingModes = 12;

PoseSource pose_source(const ElasticSystem& system, const LinearModes& modes, const Eigen::MatrixXd& derivatives,
                       const Eigen::MatrixXd& free_basis, double body_size, const Eigen::MatrixXd& examples);

/// Takes in motions [f x N] of full space, of which the first `own` are the scene's own, and others for held-out poses.
void set_motions(const Eigen::MatrixXd& motions, Eigen::Index own, const Eigen::MatrixXd& others,
                 const ElasticSystem& system, const Eigen::MatrixXd& free_basis, PoseSource& source);

/// [count x r] poses: on the manifold of modes and modal derivatives, largest displacement uniform in (0.05, 1) 0.4 L;
/// a quarter of them, where there are examples, on segments between two examples (the rest pose is one); all with noise
/// of one percent of their linear energy. Where there are motions, six of eight poses are theirs, half of these
/// of the scene's own run; the other two are on the manifold and on a segment. docs/method.md, "Cubature".
RowMatrix draw_poses(const PoseSource& source, Eigen::Index count, std::uint64_t seed);

/// The same of the other motions.
RowMatrix draw_heldout_poses(const PoseSource& source, Eigen::Index count, std::uint64_t seed);

}  // namespace exmat::precompute
