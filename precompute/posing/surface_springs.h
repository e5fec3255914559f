#pragma once

#include <Eigen/SparseCore>

#include "common/mesh/tet_mesh.h"
#include "precompute/mesh_io/surface_file.h"
#include "precompute/render/embedding.h"

namespace exmat::precompute {

/// [v] a third of the area of the triangles about each vertex, over the area of all.
Eigen::VectorXd vertex_shares(const SurfaceMesh& surface);

/// Springs of unit stiffness, shared out by area, from the points of a cage that are a surface's vertices to places of
/// them: half of the mean squared distance.
class SurfaceSprings {
 public:
  SurfaceSprings(const TetMesh& cage, const SurfaceMesh& surface, const Embedding& embedding,
                 const VertexArray& places);

  /// At positions x [n x 3] of the cage's vertices [m^2].
  double energy(const VertexArray& x) const;
  /// [n x 3] its derivative [m].
  VertexArray gradient(const VertexArray& x) const;
  /// [3n x 3n] its second derivative, with entries where two vertices have a tet in common.
  const Eigen::SparseMatrix<double, Eigen::RowMajor>& hessian() const { return hessian_; }

  /// Root of the mean squared distance over the area, and the largest [m].
  double rms(const VertexArray& x) const { return std::sqrt(2 * energy(x)); }
  double farthest(const VertexArray& x, Eigen::Index& worst) const;  ///< and the vertex of the surface

 private:
  Eigen::SparseMatrix<double, Eigen::RowMajor> interpolation_;  // v x n
  Eigen::VectorXd shares_;
  VertexArray places_;
  Eigen::SparseMatrix<double, Eigen::RowMajor> hessian_;
};

/// Places of a cage's vertices, each moved rigidly with the surface about it (moving least squares, Schaefer et
/// al. 2006): [n x 3]. Surfaces of thousands of vertices by some of them.
VertexArray rigid_start(const TetMesh& cage, const SurfaceMesh& surface, const VertexArray& posed);

}  // namespace exmat::precompute
