#include "precompute/alignment/aligned_shape.h"

#include <algorithm>

#include "common/core/decompositions.h"
#include "common/mesh/geometry.h"

namespace exmat::precompute {

VertexArray placed_positions(const TetMesh& mesh, const Placing& placing) {
  return placing.size * normalised_positions(mesh) * placing.rotation.transpose();
}

AlignedShape aligned_shape(const TetMesh& mesh, Eigen::Index functions, const std::string& name,
                           const Placing& placing) {
  const Eigen::Index count = std::min(std::max(functions, kAlignmentFunctions), mesh.vertex_count() - 2);
  AlignedShape shape{{}, laplace_basis(mesh, count, name), surface_triangles(mesh.tets)};
  shape.basis.vertices = placed_positions(mesh, placing);
  shape.mesh = {shape.basis.vertices, mesh.tets};
  return shape;
}

Eigen::MatrixXd polar_factor(const Eigen::MatrixXd& matrix) {
  const Eigen::BDCSVD<Eigen::MatrixXd> svd(matrix, Eigen::ComputeThinU | Eigen::ComputeThinV);
  return svd.matrixU() * svd.matrixV().transpose();
}

VertexArray carried_positions(const AlignedShape& a, const AlignedShape& b, const Eigen::MatrixXd& map) {
  const auto functions = b.basis.eigenfunctions.leftCols(map.cols());
  const Eigen::MatrixXd carried = map * (functions.transpose() * (b.basis.mass * b.basis.vertices));
  return a.basis.eigenfunctions.leftCols(map.rows()) * carried;
}

}  // namespace exmat::precompute
