#include "precompute/shape_space/projection.h"

#include <cmath>

#include "common/core/decompositions.h"

namespace exmat::precompute {
namespace {

// Directions of a matrix that are this much weaker than the strongest are outside its range.
constexpr double kRangeTolerance = 1e-8;

// [m x 3] row-major as a vector of 3m, entry 3i + axis.
Eigen::VectorXd flatten(const RowMatrix& descriptor) { return descriptor.reshaped<Eigen::RowMajor>(); }

}  // namespace

Eigen::VectorXd descriptor_weights(const LaplaceBasis& object, Weighting weighting) {
  if (weighting == Weighting::kEigenvalue) return object.eigenvalues;
  return Eigen::VectorXd::Ones(object.eigenvalues.size());
}

RowMatrix shape_changes(const LaplaceBasis& object, const Eigen::VectorXd& weights, const RowMatrix& displacements) {
  const Eigen::Index n = object.vertices.rows(), m = weights.size();
  const Eigen::MatrixXd forward =
      object.mass * (object.eigenfunctions * weights.asDiagonal()) / std::cbrt(object.volume);
  RowMatrix changes(3 * m, displacements.cols());
  for (int axis = 0; axis < 3; ++axis) {
    const RowMatrix rows = displacements(Eigen::seqN(axis, n, 3), Eigen::all);
    changes(Eigen::seqN(axis, m, 3), Eigen::all) = forward.transpose() * rows;
  }
  return changes;
}

ProjectionData direct_projection(const LaplaceBasis& object, const Eigen::VectorXd& weights, const SparseMatrix& mass,
                                 const RowMatrix& basis) {
  const Eigen::Index n = object.vertices.rows(), m = weights.size(), r = basis.cols();
  const double unit = std::cbrt(object.volume);
  const Eigen::MatrixXd backward = object.eigenfunctions * weights.cwiseInverse().asDiagonal() * unit;
  const RowMatrix mass_basis = mass * basis;
  ProjectionData projection;
  projection.shape_from_reduced = shape_changes(object, weights, basis);
  projection.reduced_from_shape.resize(r, 3 * m);
  for (int axis = 0; axis < 3; ++axis) {
    const auto rows = Eigen::seqN(axis, n, 3);
    const auto shape_rows = Eigen::seqN(axis, m, 3);
    const RowMatrix mass_basis_rows = mass_basis(rows, Eigen::all);
    projection.reduced_from_shape(Eigen::all, shape_rows) = mass_basis_rows.transpose() * backward;
  }
  return projection;
}

RowMatrix range_basis(const RowMatrix& matrix) {
  const Eigen::JacobiSVD<Eigen::MatrixXd> svd(matrix, Eigen::ComputeThinU);
  const auto& sigma = svd.singularValues();
  const Eigen::Index rank = (sigma.array() > kRangeTolerance * sigma[0]).count();
  return svd.matrixU().leftCols(rank);
}

Eigen::VectorXd reconstruct_displacement(const LaplaceBasis& object, const Eigen::VectorXd& weights,
                                         const Eigen::MatrixXd& descriptor_change) {
  const RowMatrix field =
      object.eigenfunctions * (weights.cwiseInverse().asDiagonal() * descriptor_change) * std::cbrt(object.volume);
  return flatten(field);
}

namespace {

// [3m x K] E.
Eigen::MatrixXd descriptors(const ExampleSet& set) {
  Eigen::MatrixXd E(set.examples.front().descriptor.size(), std::ssize(set.examples));
  for (Eigen::Index k = 0; k < E.cols(); ++k) E.col(k) = flatten(set.examples[static_cast<std::size_t>(k)].descriptor);
  return E;
}

void fill_problem(const Eigen::MatrixXd& rest_descriptor, const ProjectionData& projection, ExampleSet& set) {
  fill_gram(rest_descriptor, set);
  set.hq = descriptors(set).transpose() * projection.shape_from_reduced;
}

}  // namespace

void fill_gram(const Eigen::MatrixXd& rest_descriptor, ExampleSet& set) {
  const Eigen::MatrixXd E = descriptors(set);
  set.gram = E.transpose() * E;
  set.h0 = E.transpose() * flatten(rest_descriptor);
}

void fill_weights_problem(const Eigen::MatrixXd& rest_descriptor, const ProjectionData& projection,
                          const RowMatrix& pose_map, ExampleSet& set) {
  for (auto& example : set.examples) {
    const Eigen::VectorXd change = flatten(example.descriptor) - flatten(rest_descriptor);
    example.reduced = projection.reduced_from_shape * change;
    example.pose = pose_map * change;
  }
  fill_problem(rest_descriptor, projection, set);
}

void add_shifts(const Eigen::MatrixXd& rest_descriptor, const ProjectionData& projection, const RowMatrix& changes,
                ExampleSet& set) {
  for (Eigen::Index k = 0; k < changes.cols(); ++k) {
    RowMatrix& descriptor = set.examples[static_cast<std::size_t>(k + 1)].descriptor;
    descriptor += changes.col(k).reshaped<Eigen::RowMajor>(descriptor.rows(), 3);
  }
  fill_problem(rest_descriptor, projection, set);
}

}  // namespace exmat::precompute
