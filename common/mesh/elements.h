#pragma once

#include <Eigen/Core>
#include <Eigen/SparseCore>
#include <cstdint>
#include <span>
#include <vector>

#include "common/core/arrays.h"
#include "common/elastic/material.h"
#include "common/mesh/tet_mesh.h"

namespace exmat {

/// Lists of indices, one after another.
struct IndexLists {
  std::vector<std::int32_t> starts{0}, indices;

  std::size_t size() const { return starts.size() - 1; }
  std::span<const std::int32_t> operator[](std::size_t list) const {
    return {indices.data() + starts[list], indices.data() + starts[list + 1]};
  }
  /// Makes a list of what was added to `indices` since the last one.
  void close() { starts.push_back(static_cast<std::int32_t>(indices.size())); }
};

/// The four vertices of each tet of a mesh, in its order.
IndexLists corners_of(const TetMesh& mesh);

/// The lists around each of the indices 0 to `count` - 1, ascending: those that have it.
IndexLists lists_around(std::int32_t count, const IndexLists& lists);

/// Elements are what the elastic energy of a mesh is a sum over: in each of the e elements the displacement gradient
/// H_e = sum_j u_j b_ej^T is constant, and there is a constant matrix beside them.
///     W(u) = sum_e V_e Psi(I + H_e) + 1/2 u^T (S x I) u
/// Linear: an element is a tet, b_ej the gradients of its shape functions; S is zero. Smoothed: an element is the ring
/// of tets around a vertex (one for each material there), of each tet a quarter of its volume; b_ej are the means of
/// the gradients, and S counts by beta mu how far the gradients of the tets differ from their mean (variance_matrix).
/// Dohrmann et al. 2000; Puso and Solberg 2006. docs/method.md, "Elements".
struct Elements {
  IndexLists vertices;  ///< e lists; of a tet in its order, of a ring ascending
  Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>
      gradients;                   ///< b_ej [1/m], a row for each of vertices.indices
  IndexLists tets;                 ///< e lists, ascending
  IndexVector centres;             ///< e, the vertex of each ring; none of linear elements
  Eigen::VectorXd volumes;         ///< e [m^3]
  Eigen::VectorXd youngs_modulus;  ///< e [Pa]
  Eigen::VectorXd poisson_ratio;   ///< e

  Eigen::Index count() const { return volumes.size(); }
  bool smoothed() const { return centres.size() > 0; }
  LameParameters lame(Eigen::Index element) const {
    return lame_parameters(youngs_modulus[element], poisson_ratio[element]);
  }
  /// [k x 3] of the k vertices of an element.
  auto gradients_of(Eigen::Index element) const {
    const std::int32_t start = vertices.starts[static_cast<std::size_t>(element)];
    return gradients.middleRows(start, vertices.starts[static_cast<std::size_t>(element) + 1] - start);
  }
  std::span<const std::int32_t> vertices_of(Eigen::Index element) const {
    return vertices[static_cast<std::size_t>(element)];
  }
  std::span<const std::int32_t> tets_of(Eigen::Index element) const { return tets[static_cast<std::size_t>(element)]; }
  /// H_e of a field u [3n].
  template <typename Field>
  Eigen::Matrix3d displacement_gradient(Eigen::Index element, const Field& u) const {
    const auto own = gradients_of(element);
    Eigen::Matrix3d H = Eigen::Matrix3d::Zero();
    Eigen::Index j = 0;
    for (const std::int32_t vertex : vertices_of(element)) H += u.template segment<3>(3 * vertex) * own.row(j++);
    return H;
  }
};

/// By the formulation of the materials.
Elements elements_of(const TetMesh& mesh, const TetMaterials& materials);

/// [e] the mean of values of tets [n_t] over each element, by volume.
Eigen::VectorXd mean_over_elements(const TetMesh& mesh, const Elements& elements, const Eigen::VectorXd& values);

/// [n x n] S, symmetric and positive semi-definite, zero for affine displacements [N/m]: sum over the rings of
/// beta mu sum_t (V_t/4) (grad_t - b) (grad_t - b)^T; no entries where the formulation is linear. Compressed rows, both
/// triangles.
Eigen::SparseMatrix<double, Eigen::RowMajor> variance_matrix(const TetMesh& mesh, const TetMaterials& materials,
                                                             const Elements& elements);

}  // namespace exmat
