#pragma once

#include <Eigen/SparseCore>
#include <cstdint>
#include <vector>

#include "common/elastic/material.h"
#include "common/mesh/elements.h"
#include "common/mesh/tet_mesh.h"
#include "runtime/sim/elasticity/element_potential.h"

namespace exmat::precompute {

/// Lower triangle of a symmetric [f x f] matrix, by columns.
using LowerTriangle = Eigen::SparseMatrix<double>;

/// Elastic energy of a mesh by all of its elements, its force and stiffness. The displacements u [f] are those of the
/// free degrees of freedom, the others are 0. Bonet and Wood 2008, sections 9.3 and 9.4; see Elements.
class MeshElasticity {
 public:
  MeshElasticity() = default;
  /// `free_dofs` of the 3n ascend, three of each free vertex.
  MeshElasticity(const TetMesh& mesh, const TetMaterials& materials, const std::vector<std::int32_t>& free_dofs);

  Eigen::Index size() const { return size_; }
  Eigen::Index elements() const { return elements_.count(); }

  /// Zeros where a stiffness or a mass matrix of the mesh has entries.
  const LowerTriangle& pattern() const { return pattern_; }

  /// The shape of no energy that displacements start from, instead of that of the mesh: [n x 3]. Energies are
  /// V det F* Psi(F F*^-1) of each element, F* its deformation gradient there; without the variance term, which a
  /// rotation of a bent shape would change. Elements that it turns inside out are left out of all sums; returns their
  /// number.
  Eigen::Index set_undeformed(const VertexArray& positions);

  /// Counts each tet by its share [n_t] >= 0 in the sums over elements, for good; 0 leaves it out. Before
  /// set_undeformed().
  void set_shares(const Eigen::VectorXd& shares);

  /// [J].
  double energy(const Eigen::VectorXd& u) const;

  /// `force` [f] = its derivative [N]. Returns the energy.
  double force(const Eigen::VectorXd& u, Eigen::VectorXd& force) const;

  /// And `stiffness` [N/m], its second derivative, on pattern().
  double force_and_stiffness(const Eigen::VectorXd& u, runtime::Tangent tangent, Eigen::VectorXd& force,
                             LowerTriangle& stiffness) const;

  /// Values of a matrix of which pattern() has all entries [f x f, both triangles], in the order of pattern()'s.
  Eigen::VectorXd values_of(const Eigen::SparseMatrix<double, Eigen::RowMajor>& matrix) const;

 private:
  void build_pattern();
  void build_variance();
  Eigen::Matrix3d displacement_gradient(Eigen::Index element, const Eigen::VectorXd& u) const;
  void add_force(Eigen::Index element, const Eigen::Matrix3d& stress, Eigen::VectorXd& force) const;
  void add_stiffness(Eigen::Index element, const Matrix9& tangent, double* values) const;
  double add_variance(const Eigen::VectorXd& u, Eigen::VectorXd* force) const;
  template <typename Work>
  void for_each_element(const Eigen::VectorXd& u, Work&& work) const;

  Eigen::Index size_ = 0;
  TetMesh mesh_;
  TetMaterials materials_;
  Elements elements_;
  std::vector<std::int32_t> unknowns_;       // of each vertex, its first; -1 where fixed
  decltype(Elements::gradients) gradients_;  // of the elements, from the undeformed shape on
  Eigen::VectorXd rest_volumes_;             // of the elements, times the share
  Eigen::VectorXd volumes_;                  // of the undeformed shape; 0 where an element is left out
  // Places among the values of the blocks of each element's pairs of free vertices i, j, i not before j, row by row in
  // the element's order: the first entry of the first column.
  std::vector<std::size_t> starts_;
  std::vector<std::int32_t> slots_;
  LowerTriangle pattern_;
  Eigen::SparseMatrix<double, Eigen::RowMajor> variance_;  // f/3 x f/3
  Eigen::VectorXd variance_values_;                        // on pattern_
  bool has_variance_ = false;
};

}  // namespace exmat::precompute
