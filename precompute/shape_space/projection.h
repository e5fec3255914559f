#pragma once

#include "common/model/reduced_model.h"
#include "precompute/shape_space/laplace_basis.h"

namespace exmat::precompute {

/// Lambda of docs/method.md, "Shape space": the eigenvalues, or ones.
Eigen::VectorXd descriptor_weights(const LaplaceBasis& object, Weighting weighting);

/// T and T^+; the range of the targets is left to range_basis(). `basis` is U, 3n x r; `mass` M, 3n x 3n; `object`
/// holds the first m functions. docs/method.md, "Direct projection".
ProjectionData direct_projection(const LaplaceBasis& object, const Eigen::VectorXd& weights, const SparseMatrix& mass,
                                 const RowMatrix& basis);

/// Orthonormal basis of the range of a matrix, directions of rounding left out.
RowMatrix range_basis(const RowMatrix& matrix);

/// [3n] displacement V^(1/3) Phi Lambda^-1 (delta e) of a change of descriptor [m x 3]. docs/method.md, "Direct
/// projection".
Eigen::VectorXd reconstruct_displacement(const LaplaceBasis& object, const Eigen::VectorXd& weights,
                                         const Eigen::MatrixXd& descriptor_change);

/// Fills in the part of the weights problem that does not depend on a basis: Gram matrix and constant terms, from the
/// descriptors.
void fill_gram(const Eigen::MatrixXd& rest_descriptor, ExampleSet& set);

/// [3m x d] changes of descriptor T B that displacements B [3n x d] make; of a region, those that it sees of them.
RowMatrix shape_changes(const LaplaceBasis& object, const Eigen::VectorXd& weights, const RowMatrix& displacements);

/// Gram matrix and linear terms of the weights problem from the descriptors, and the examples in reduced coordinates:
/// `reduced` by T^+, `pose` by the pose map. docs/method.md, "Regions".
void fill_weights_problem(const Eigen::MatrixXd& rest_descriptor, const ProjectionData& projection,
                          const RowMatrix& pose_map, ExampleSet& set);

/// Then, of examples that shift the body beside what they are by `changes` of descriptor [3m x (K-1)]: descriptors, and
/// the weights problem, become those of the whole poses.
void add_shifts(const Eigen::MatrixXd& rest_descriptor, const ProjectionData& projection, const RowMatrix& changes,
                ExampleSet& set);

}  // namespace exmat::precompute
