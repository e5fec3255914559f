#include "precompute/fem/assembly.h"

#include <vector>

#include "common/elastic/material.h"
#include "common/mesh/geometry.h"

namespace exmat::precompute {
namespace {

using Triplet = Eigen::Triplet<double>;

// Sums element(t), a [4 x 4] matrix of each tet, into an n x n matrix.
template <typename ElementMatrix>
SparseMatrix assemble_scalar(const TetMesh& mesh, const ElementMatrix& element) {
  std::vector<Triplet> entries;
  entries.reserve(static_cast<std::size_t>(16 * mesh.tet_count()));
  for (Eigen::Index t = 0; t < mesh.tet_count(); ++t) {
    const Eigen::Matrix4d local = element(t);
    for (int i = 0; i < 4; ++i)
      for (int j = 0; j < 4; ++j) entries.emplace_back(mesh.tets(t, i), mesh.tets(t, j), local(i, j));
  }
  SparseMatrix matrix(mesh.vertex_count(), mesh.vertex_count());
  matrix.setFromTriplets(entries.begin(), entries.end());
  return matrix;
}

// 12 x 12: lambda g_i g_j^T + mu g_j g_i^T + mu (g_i . g_j) I for each pair of corners, times the volume.
Eigen::Matrix<double, 12, 12> element_stiffness(const Eigen::Matrix<double, 4, 3>& gradients, double volume,
                                                const LameParameters& lame) {
  Eigen::Matrix<double, 12, 12> local;
  for (int i = 0; i < 4; ++i)
    for (int j = 0; j < 4; ++j) {
      const Eigen::Vector3d gi = gradients.row(i), gj = gradients.row(j);
      local.block<3, 3>(3 * i, 3 * j) = volume * (lame.lambda * gi * gj.transpose() + lame.mu * gj * gi.transpose() +
                                                  lame.mu * gi.dot(gj) * Eigen::Matrix3d::Identity());
    }
  return local;
}

}  // namespace

SparseMatrix scalar_mass(const TetMesh& mesh) { return scalar_mass(mesh, Eigen::VectorXd::Ones(mesh.tet_count())); }

SparseMatrix scalar_mass(const TetMesh& mesh, const Eigen::VectorXd& density) {
  const Eigen::VectorXd volumes = tet_volumes(mesh);
  const Eigen::Matrix4d reference = (Eigen::Matrix4d::Ones() + Eigen::Matrix4d::Identity()) / 20.0;
  return assemble_scalar(mesh, [&](Eigen::Index t) -> Eigen::Matrix4d { return density[t] * volumes[t] * reference; });
}

SparseMatrix laplacian_stiffness(const TetMesh& mesh) {
  const Eigen::VectorXd volumes = tet_volumes(mesh);
  return assemble_scalar(mesh, [&](Eigen::Index t) -> Eigen::Matrix4d {
    const auto gradients = shape_gradients(tet_positions(mesh, t));
    return volumes[t] * gradients * gradients.transpose();
  });
}

SparseMatrix elastic_stiffness(const TetMesh& mesh, const TetMaterials& materials) {
  const Eigen::VectorXd volumes = tet_volumes(mesh);
  std::vector<Triplet> entries;
  entries.reserve(static_cast<std::size_t>(144 * mesh.tet_count()));
  for (Eigen::Index t = 0; t < mesh.tet_count(); ++t) {
    const auto lame = lame_parameters(materials.youngs_modulus[t], materials.poisson_ratio[t]);
    const auto local = element_stiffness(shape_gradients(tet_positions(mesh, t)), volumes[t], lame);
    for (int i = 0; i < 12; ++i)
      for (int j = 0; j < 12; ++j)
        entries.emplace_back(3 * mesh.tets(t, i / 3) + i % 3, 3 * mesh.tets(t, j / 3) + j % 3, local(i, j));
  }
  SparseMatrix matrix(3 * mesh.vertex_count(), 3 * mesh.vertex_count());
  matrix.setFromTriplets(entries.begin(), entries.end());
  return matrix;
}

SparseMatrix expand_to_vectors(const SparseMatrix& scalar) {
  SparseMatrix expanded(3 * scalar.rows(), 3 * scalar.cols());
  Eigen::VectorXi row_sizes(expanded.rows());
  for (Eigen::Index row = 0; row < scalar.rows(); ++row)
    row_sizes.segment<3>(3 * row).setConstant(scalar.outerIndexPtr()[row + 1] - scalar.outerIndexPtr()[row]);
  expanded.reserve(row_sizes);
  for (Eigen::Index row = 0; row < scalar.rows(); ++row)
    for (int axis = 0; axis < 3; ++axis)
      for (SparseMatrix::InnerIterator entry(scalar, row); entry; ++entry)
        expanded.insert(3 * row + axis, 3 * entry.col() + axis) = entry.value();
  expanded.makeCompressed();
  return expanded;
}

SparseMatrix submatrix(const SparseMatrix& matrix, const std::vector<std::int32_t>& kept) {
  std::vector<std::int32_t> new_index(static_cast<std::size_t>(matrix.cols()), -1);
  for (std::size_t i = 0; i < kept.size(); ++i)
    new_index[static_cast<std::size_t>(kept[i])] = static_cast<std::int32_t>(i);
  const auto size = static_cast<Eigen::Index>(kept.size());
  std::vector<Triplet> entries;
  entries.reserve(static_cast<std::size_t>(matrix.nonZeros()));
  for (Eigen::Index i = 0; i < size; ++i)
    for (SparseMatrix::InnerIterator entry(matrix, kept[static_cast<std::size_t>(i)]); entry; ++entry)
      if (const auto column = new_index[static_cast<std::size_t>(entry.col())]; column >= 0)
        entries.emplace_back(static_cast<int>(i), column, entry.value());
  SparseMatrix sub(size, size);
  sub.setFromTriplets(entries.begin(), entries.end());
  return sub;
}

}  // namespace exmat::precompute
