#pragma once

#include <Eigen/SparseCore>
#include <cstdint>
#include <vector>

#include "common/elastic/material.h"
#include "common/mesh/tet_mesh.h"
#include "runtime/sim/elasticity/element_potential.h"

namespace exmat::precompute {

/// Lower triangle of a symmetric [f x f] matrix, by columns.
using LowerTriangle = Eigen::SparseMatrix<double>;

/// Elastic energy of a mesh by all of its tets, its force and stiffness. The displacements u [f] are those of the free
/// degrees of freedom, the others are 0. Linear elements: F is constant in each tet. Bonet and Wood 2008, sections 9.3
/// and 9.4.
class MeshElasticity {
 public:
  MeshElasticity() = default;
  /// `free_dofs` of the 3n ascend.
  MeshElasticity(const TetMesh& mesh, const TetMaterials& materials, const std::vector<std::int32_t>& free_dofs);

  Eigen::Index size() const { return size_; }
  Eigen::Index tet_count() const { return static_cast<Eigen::Index>(gradients_.size()); }

  /// Zeros where a stiffness or a mass matrix of the mesh has entries.
  const LowerTriangle& pattern() const { return pattern_; }

  /// The shape of no energy that displacements start from, instead of that of the mesh: [n x 3]. Tets that it turns
  /// inside out are left out of all sums; returns their number.
  Eigen::Index set_undeformed(const VertexArray& positions);

  /// Counts each tet by its share [n_t] >= 0 in all sums, for good; 0 leaves it out.
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
  using Gradients = Eigen::Matrix<double, 4, 3>;
  using Corners = Eigen::Matrix<std::int32_t, 12, 1>;
  using Slots = Eigen::Matrix<std::int32_t, 12, 12>;

  void build_pattern();
  Eigen::Matrix3d displacement_gradient(Eigen::Index tet, const Eigen::VectorXd& u) const;
  void add_force(Eigen::Index tet, const Eigen::Matrix3d& stress, Eigen::VectorXd& force) const;
  void add_stiffness(Eigen::Index tet, const Matrix9& tangent, double* values) const;
  template <typename Work>
  void for_each_tet(const Eigen::VectorXd& u, Work&& work) const;

  Eigen::Index size_ = 0;
  MaterialModel material_ = MaterialModel::kStVenantKirchhoff;
  TetArray tets_;
  Eigen::VectorXd shares_;  // none: all 1
  std::vector<LameParameters> lame_;
  std::vector<Gradients> gradients_;  // of the shape functions
  Eigen::VectorXd volumes_;           // times the share; 0 where a tet is left out
  std::vector<Corners> dofs_;         // of each tet; -1 where fixed
  std::vector<Slots> slots_;          // places of a tet's stiffness among the values; -1 where there is none
  LowerTriangle pattern_;
};

}  // namespace exmat::precompute
