#pragma once

#include "common/core/arrays.h"
#include "common/elastic/material.h"
#include "common/mesh/tet_mesh.h"

namespace exmat::precompute {

/// Reduced elasticity of single tets: what cubature chooses from, and the sum over all of them.
class ElementSamples {
 public:
  /// `basis` is U, 3n x r. All three must outlive this.
  ElementSamples(const TetMesh& mesh, const TetMaterials& materials, const RowMatrix& basis);

  Eigen::Index count() const { return mesh_.tet_count(); }
  Eigen::Index modes() const { return basis_.cols(); }
  double volume(Eigen::Index tet) const { return volumes_[tet]; }

  /// [9 x r] B_j = dF/dq, row 3a + b.
  RowMatrix gradient(Eigen::Index tet) const;

  /// Reduced internal forces [r x N] and energies [N] of one tet at [N x r] poses, times its volume.
  struct Response {
    Eigen::MatrixXd forces;
    Eigen::VectorXd energies;
  };
  Response response(Eigen::Index tet, const RowMatrix& poses) const;

  /// [r x r] reduced stiffness of one tet at one pose, times its volume.
  Eigen::MatrixXd stiffness(Eigen::Index tet, const Eigen::VectorXd& pose) const;

 private:
  LameParameters lame(Eigen::Index tet) const;

  const TetMesh& mesh_;
  const TetMaterials& materials_;
  const RowMatrix& basis_;
  Eigen::VectorXd volumes_;
};

}  // namespace exmat::precompute
