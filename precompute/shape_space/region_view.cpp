#include "precompute/shape_space/region_view.h"

#include <Eigen/Geometry>
#include <Eigen/QR>

#include "common/mesh/geometry.h"

namespace exmat::precompute {
namespace {

// The region's vertices that share a tet with others.
FlagVector border_of(const TetMesh& mesh, const FlagVector& inside) {
  FlagVector border = FlagVector::Zero(inside.size());
  for (const auto& tet : mesh.tets.rowwise()) {
    const FlagVector corners = inside(tet.transpose());
    if (corners.all() || !corners.any()) continue;
    for (const auto vertex : tet) border[vertex] |= inside[vertex];
  }
  return border;
}

Eigen::VectorXd lumped_volumes(const TetMesh& mesh) {
  const Eigen::VectorXd volumes = tet_volumes(mesh);
  Eigen::VectorXd lumped = Eigen::VectorXd::Zero(mesh.vertex_count());
  for (Eigen::Index t = 0; t < mesh.tet_count(); ++t)
    for (const auto vertex : mesh.tets.row(t)) lumped[vertex] += volumes[t] / 4;
  return lumped;
}

// [3n x 6] translations along and rotations about the axes, zero outside of the flagged vertices.
Eigen::MatrixXd rigid_motions_of(const VertexArray& vertices, const Eigen::RowVector3d& centre,
                                 const FlagVector& flags) {
  Eigen::MatrixXd motions = Eigen::MatrixXd::Zero(3 * vertices.rows(), 6);
  for (Eigen::Index v = 0; v < vertices.rows(); ++v) {
    if (flags[v] == 0) continue;
    const Eigen::Vector3d arm = (vertices.row(v) - centre).transpose();
    for (int axis = 0; axis < 3; ++axis) {
      motions(3 * v + axis, axis) = 1;
      motions.col(3 + axis).segment<3>(3 * v) = Eigen::Vector3d::Unit(axis).cross(arm);
    }
  }
  return motions;
}

Eigen::VectorXd each_axis(const Eigen::VectorXd& of_vertices) {
  return of_vertices.replicate(1, 3).transpose().reshaped();
}

}  // namespace

RegionView::RegionView(const TetMesh& mesh, const FlagVector& inside, const FlagVector& fixed) : inside_(inside) {
  const FlagVector held = inside.cwiseProduct(fixed);
  const FlagVector border = border_of(mesh, inside);
  const Eigen::VectorXd volumes = lumped_volumes(mesh);
  frame_ = volumes.cwiseProduct((held.any() ? held : border).cast<double>());
  if (held.any() || !border.any()) return;
  const Eigen::RowVector3d centre = frame_.transpose() * mesh.vertices / frame_.sum();
  rigid_ = rigid_motions_of(mesh.vertices, centre, inside);
  const Eigen::MatrixXd weighted = each_axis(frame_).asDiagonal() * rigid_;
  border_ = weighted * Eigen::MatrixXd(rigid_.transpose() * weighted).completeOrthogonalDecomposition().pseudoInverse();
}

Eigen::MatrixXd RegionView::see(const Eigen::MatrixXd& displacements) const {
  Eigen::MatrixXd seen = each_axis(inside_.cast<double>()).asDiagonal() * displacements;
  if (border_.size() > 0) seen -= rigid_ * (border_.transpose() * displacements);
  return seen;
}

Eigen::MatrixXd RegionView::transposed(const Eigen::MatrixXd& forces) const {
  Eigen::MatrixXd seen = each_axis(inside_.cast<double>()).asDiagonal() * forces;
  if (border_.size() > 0) seen -= border_ * (rigid_.transpose() * forces);
  return seen;
}

}  // namespace exmat::precompute
