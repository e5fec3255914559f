#include "precompute/shape_space/region_view.h"

#include <Eigen/Geometry>
#include <utility>

#include "common/core/decompositions.h"
#include "precompute/shape_space/region_window.h"

namespace exmat::precompute {
namespace {

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
  RegionWindow window = region_window(mesh, inside);
  window_ = std::move(window.values);
  const FlagVector held = inside.cwiseProduct(fixed);
  if (held.any()) {
    frame_ = lumped_volumes(mesh).cwiseProduct(held.cast<double>());
    return;
  }
  frame_ = std::move(window.band);
  if (frame_.isZero(0)) return;
  const Eigen::RowVector3d centre = frame_.transpose() * mesh.vertices / frame_.sum();
  const Eigen::MatrixXd rigid = rigid_motions_of(mesh.vertices, centre, inside);
  const Eigen::MatrixXd weighted = each_axis(frame_).asDiagonal() * rigid;
  band_ = weighted * Eigen::MatrixXd(rigid.transpose() * weighted).completeOrthogonalDecomposition().pseudoInverse();
  rigid_ = each_axis(window_).asDiagonal() * rigid;
}

Eigen::MatrixXd RegionView::see(const Eigen::MatrixXd& displacements) const {
  Eigen::MatrixXd seen = each_axis(window_).asDiagonal() * displacements;
  if (band_.size() > 0) seen -= rigid_ * (band_.transpose() * displacements);
  return seen;
}

Eigen::MatrixXd RegionView::transposed(const Eigen::MatrixXd& forces) const {
  Eigen::MatrixXd seen = each_axis(window_).asDiagonal() * forces;
  if (band_.size() > 0) seen -= band_ * (rigid_.transpose() * forces);
  return seen;
}

}  // namespace exmat::precompute
