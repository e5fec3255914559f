#pragma once

#include <string>
#include <vector>

#include "common/model/reduced_model.h"
#include "precompute/shape_space/laplace_basis.h"

namespace exmat::precompute {

/// Map from an example file's body to the object: docs/alignment.md.
struct RestMap {
  Eigen::MatrixXd functional_map;  ///< C_0, m x K_e, orthonormal rows
  SparseMatrix pull_back;          ///< n x n_e, values at the nearest point of the rest example for each object vertex
  double residual = 0;  ///< RMS distance of the object's vertices from the rest example, over the object's RMS radius
  double doubt = 0;     ///< residual + |C - polar(C)|_F / sqrt(m) of the pulled-back functions; 0 is certain
  bool same_frame = true;     ///< the rest example coincides with the object within kSameFrame
  bool by_functions = false;  ///< fields come over by the functional map, not by the pull-back

  /// [m x 3] coefficients on the object of a field [n_e x 3] on the rest example.
  Eigen::MatrixXd carried(const LaplaceBasis& object, const LaplaceBasis& rest_basis, const VertexArray& field) const;
};

/// Members that the stage cache keeps.
template <typename Archive>
void pass_members(Archive& archive, RestMap& value) {
  pass_all(archive, value.functional_map, value.pull_back, value.residual, value.doubt, value.same_frame,
           value.by_functions);
}

/// Residual up to which the rest example is taken to share the object's frame.
constexpr double kSameFrame = 0.05;

/// Number of example functions for m of the object: 1.5 m + 5, bounded by the mesh.
Eigen::Index example_function_count(Eigen::Index m, Eigen::Index vertices);

/// C_0 = polar(Phi_o^T M_o Phi_e[p]) with p the nearest point of the rest example for each object vertex, both
/// normalised. `object` holds the object's first m functions.
RestMap rest_map(const LaplaceBasis& object, const TetMesh& rest_mesh, const LaplaceBasis& rest_basis);

/// The identity map of an object of m functions that is its own rest example.
RestMap identity_map(Eigen::Index m, Eigen::Index vertices);

/// A pose of the rest example's mesh, in the object's shape space.
struct TransferredPose {
  Eigen::MatrixXd coefficients;                  ///< m x 3, of the posed object
  RowMatrix3 rotation = RowMatrix3::Identity();  ///< from the example's frame to the object's
  VertexArray
      displacement;  ///< n x 3, of the object to the pose, normalised and with zero mean, not cut to m functions
  double shape_space_error =
      0;  ///< |d - d_m|_M / |d|_M on the object: d the example's displacement, d_m what came over
};

/// Frame that a pose is brought into once it is transferred. docs/method.md, "Shape space".
struct PoseFrame {
  bool free_example = false;  ///< rotate the example to the rest example first (alignment.frame: free)
  /// n x n weights of the fit of the posed to the rest object: the mass of a free body; ones at the fixed vertices of a
  /// clamped one.
  SparseMatrix fit_weights;
  /// Fit the whole pose, where it is known, not what the m functions have of it: theirs turns at a clamp. For a free
  /// body theirs leaves no rigid rotation that the modal basis could not hold.
  bool fit_whole = false;
};

/// `rest_coefficients` [m x 3] of the object; `posed` [n_e x 3] normalised positions on the vertices of the rest
/// example.
TransferredPose transfer_pose(const LaplaceBasis& object, const Eigen::MatrixXd& rest_coefficients, const RestMap& map,
                              const LaplaceBasis& rest_basis, const VertexArray& posed, const PoseFrame& frame);

/// The pose of the object that is displaced by [n x 3] in its normalised frame, where it stays as it stands.
TransferredPose posed_object(const LaplaceBasis& object, const Eigen::MatrixXd& rest_coefficients,
                             const VertexArray& displacement);

/// An example as a functional map carries it to the object.
struct CarriedShape {
  Eigen::MatrixXd coefficients;  ///< m x 3
  VertexArray points;            ///< n x 3, positions on the example at the object's vertices, found in another way
};

/// Members that the stage cache keeps.
template <typename Archive>
void pass_members(Archive& archive, CarriedShape& value) {
  pass_all(archive, value.coefficients, value.points);
}

/// The same from what is carried of the rest and the posed example. The coefficients alone make the pose; the points
/// give `displacement` and tell what is lost of it, shape_space_error.
TransferredPose transfer_carried(const LaplaceBasis& object, const Eigen::MatrixXd& rest_coefficients,
                                 const CarriedShape& rest, const CarriedShape& posed, const PoseFrame& frame);

/// |d - d_m| / |d| in a mass [n x n], of displacements [n x 3]; nothing is lost of none.
double lost_share(const SparseMatrix& mass, const VertexArray& displacement, const VertexArray& carried);

/// Proper rotation R that minimises sum_i w_i |R a_i - b_i|^2 for [3 x 3] moments sum_i w_i b_i a_i^T. Where the
/// moments leave the angle about an axis open (rank one), the smallest rotation is taken. Kabsch 1976; Umeyama 1991.
Eigen::Matrix3d procrustes_rotation(const Eigen::Matrix3d& moments);

}  // namespace exmat::precompute
