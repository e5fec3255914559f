#include "common/mesh/assembly.h"

#include <algorithm>
#include <vector>

#include "common/elastic/material.h"
#include "common/mesh/elements.h"
#include "common/mesh/geometry.h"

namespace exmat {
namespace {

// [n x n] zeros where vertices are in one of the lists.
SparseMatrix vertex_pattern(Eigen::Index vertices, const IndexLists& lists) {
  const IndexLists around = lists_around(static_cast<std::int32_t>(vertices), lists);
  std::vector<int> starts{0}, columns, row;
  for (std::size_t vertex = 0; vertex < around.size(); ++vertex) {
    row.clear();
    for (const std::int32_t list : around[vertex]) {
      const auto own = lists[static_cast<std::size_t>(list)];
      row.insert(row.end(), own.begin(), own.end());
    }
    std::sort(row.begin(), row.end());
    columns.insert(columns.end(), row.begin(), std::unique(row.begin(), row.end()));
    starts.push_back(static_cast<int>(columns.size()));
  }
  const std::vector<double> zeros(columns.size());
  return Eigen::Map<const SparseMatrix>(vertices, vertices, std::ssize(columns), starts.data(), columns.data(),
                                        zeros.data());
}

// Position of (row, column) among the stored entries.
Eigen::Index position(const SparseMatrix& matrix, Eigen::Index row, int column) {
  const int* columns = matrix.innerIndexPtr();
  return std::lower_bound(columns + matrix.outerIndexPtr()[row], columns + matrix.outerIndexPtr()[row + 1], column) -
         columns;
}

// Sums element(t), a [4 x 4] matrix of each tet, into an n x n matrix.
template <typename ElementMatrix>
SparseMatrix assemble_scalar(const TetMesh& mesh, const ElementMatrix& element) {
  SparseMatrix matrix = vertex_pattern(mesh.vertex_count(), corners_of(mesh));
  for (Eigen::Index t = 0; t < mesh.tet_count(); ++t) {
    const Eigen::Matrix4d local = element(t);
    for (int i = 0; i < 4; ++i)
      for (int j = 0; j < 4; ++j) matrix.valuePtr()[position(matrix, mesh.tets(t, i), mesh.tets(t, j))] += local(i, j);
  }
  return matrix;
}

// [3n x 3n] zeros where `scalar` has entries, in blocks of 3 x 3: that of its k-th entry, in row i with d entries from
// the s-th on, starts at entry 9 s + 3 (k - s) and has its rows 3 d entries apart.
SparseMatrix block_pattern(const SparseMatrix& scalar) {
  SparseMatrix blocks(3 * scalar.rows(), 3 * scalar.cols());
  blocks.resizeNonZeros(9 * scalar.nonZeros());
  int at = 0;
  for (Eigen::Index row = 0; row < scalar.rows(); ++row)
    for (int axis = 0; axis < 3; ++axis) {
      blocks.outerIndexPtr()[3 * row + axis] = at;
      for (SparseMatrix::InnerIterator entry(scalar, row); entry; ++entry)
        for (int other = 0; other < 3; ++other)
          blocks.innerIndexPtr()[at++] = 3 * static_cast<int>(entry.col()) + other;
    }
  blocks.outerIndexPtr()[blocks.rows()] = at;
  std::fill_n(blocks.valuePtr(), at, 0.0);
  return blocks;
}

// lambda g_i g_j^T + mu g_j g_i^T + mu (g_i . g_j) I.
Eigen::Matrix3d stiffness_block(const Eigen::Vector3d& gi, const Eigen::Vector3d& gj, const LameParameters& lame) {
  return lame.lambda * gi * gj.transpose() + lame.mu * gj * gi.transpose() +
         lame.mu * gi.dot(gj) * Eigen::Matrix3d::Identity();
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
  const Elements elements = elements_of(mesh, materials);
  const SparseMatrix scalar = vertex_pattern(mesh.vertex_count(), elements.vertices);
  SparseMatrix matrix = block_pattern(scalar);
  const auto add = [&](Eigen::Index row, int column, const Eigen::Matrix3d& block) {
    const Eigen::Index start = scalar.outerIndexPtr()[row], stride = 3 * (scalar.outerIndexPtr()[row + 1] - start);
    const Eigen::Index entry = position(scalar, row, column);
    for (int a = 0; a < 3; ++a)
      Eigen::Map<Eigen::RowVector3d>(matrix.valuePtr() + 9 * start + 3 * (entry - start) + a * stride) += block.row(a);
  };
  for (Eigen::Index e = 0; e < elements.count(); ++e) {
    const LameParameters lame = elements.lame(e);
    const auto vertices = elements.vertices_of(e);
    const auto gradients = elements.gradients_of(e);
    for (std::size_t i = 0; i < vertices.size(); ++i)
      for (std::size_t j = 0; j < vertices.size(); ++j)
        add(vertices[i], vertices[j],
            elements.volumes[e] * stiffness_block(gradients.row(static_cast<Eigen::Index>(i)).transpose(),
                                                  gradients.row(static_cast<Eigen::Index>(j)).transpose(), lame));
  }
  const SparseMatrix variance = variance_matrix(mesh, materials, elements);
  for (Eigen::Index row = 0; row < variance.outerSize(); ++row)
    for (SparseMatrix::InnerIterator entry(variance, row); entry; ++entry)
      add(row, static_cast<int>(entry.col()), entry.value() * Eigen::Matrix3d::Identity());
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
  SparseMatrix sub(size, size);
  sub.reserve(matrix.nonZeros());
  for (Eigen::Index i = 0; i < size; ++i) {
    sub.startVec(i);
    for (SparseMatrix::InnerIterator entry(matrix, kept[static_cast<std::size_t>(i)]); entry; ++entry)
      if (const auto column = new_index[static_cast<std::size_t>(entry.col())]; column >= 0)
        sub.insertBack(i, column) = entry.value();
  }
  sub.finalize();
  return sub;
}

}  // namespace exmat
