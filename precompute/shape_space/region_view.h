#pragma once

#include <Eigen/Core>

#include "common/core/arrays.h"
#include "common/mesh/tet_mesh.h"

namespace exmat::precompute {

/// A region as an example force sees it, linear in displacements: D'' u = D (u - R u_b), D the region's window, which
/// rises smoothly from 0 at its border, and R u_b the rigid motion that the band along the border makes. So it acts
/// inside alone, and without net force or torque: all that the rest of the body feels is that the region bends. A
/// region that holds fixed vertices, or all there are, is seen as it moves, D u.
class RegionView {
 public:
  /// `inside`, `fixed` [n] flag vertices of `mesh`.
  RegionView(const TetMesh& mesh, const FlagVector& inside, const FlagVector& fixed);

  const FlagVector& inside() const { return inside_; }       ///< n
  const Eigen::VectorXd& window() const { return window_; }  ///< n, diagonal of D, 0 to 1
  /// [n] weights of the vertices whose motion the region is seen from: those of its band, or the lumped volumes of its
  /// fixed ones; zeros where there are neither.
  const Eigen::VectorXd& frame() const { return frame_; }
  /// [n] shares of the vertices of the band, whose motion D'' takes off, 1 together; zeros where it takes none off.
  Eigen::VectorXd band() const {
    return band_.size() > 0 ? Eigen::VectorXd(frame_ / frame_.sum()) : Eigen::VectorXd::Zero(frame_.size());
  }

  /// D'' applied to displacements [3n x k].
  Eigen::MatrixXd see(const Eigen::MatrixXd& displacements) const;
  /// Its transpose applied to forces [3n x k].
  Eigen::MatrixXd transposed(const Eigen::MatrixXd& forces) const;

 private:
  FlagVector inside_;
  Eigen::VectorXd window_, frame_;
  Eigen::MatrixXd rigid_;  // 3n x 6, rigid motions as the window shows them, or no columns
  Eigen::MatrixXd band_;   // 3n x 6: band^T u are their amounts
};

}  // namespace exmat::precompute
