// BodySurface::approach_bounds(), which is made once for a surface.

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "runtime/sim/contact/body_surface.h"
#include "runtime/sim/contact/nearest_on_triangle.h"

namespace exmat::runtime {

RowMatrix BodySurface::approach_bounds(const VertexArray& rest, const RowMatrix& basis) const {
  RowMatrix bounds = RowMatrix::Zero(rest.rows(), modes());
  for (Eigen::Index i = 0; i < rest.rows(); ++i)
    for (Eigen::Index t = 0; t < triangles_.rows(); ++t) {
      const auto corner = [&](int c) -> Eigen::Vector3d { return rest_.row(triangles_(t, c)); };
      const double distance =
          std::sqrt(nearest_on_triangle(rest.row(i), corner(0), corner(1), corner(2)).squared_distance);
      const Eigen::Vector3d first = corner(1) - corner(0), second = corner(2) - corner(0);
      const bool beside = distance * distance <= kOnTriangle * kOnTriangle * first.cross(second).norm();
      Eigen::Matrix<double, 3, 2> edges;
      edges << first, second;
      const Eigen::Matrix2d metric = (edges.transpose() * edges).inverse();
      for (Eigen::Index j = 0; j < modes(); ++j) {
        const auto moved = [&](int c) -> Eigen::Vector3d { return rows_[triangles_(t, c)].col(j); };
        double ratio = 0;
        if (beside) {  // the norm of the gradient in the triangle is above that of its singular values
          Eigen::Matrix<double, 3, 2> change;
          change << moved(1) - moved(0), moved(2) - moved(0);
          ratio = std::sqrt((change * metric * change.transpose()).trace());
        } else {
          const Eigen::Vector3d own = basis.block<3, 1>(3 * i, j);
          for (int c = 0; c < 3; ++c) ratio = std::max(ratio, (moved(c) - own).norm() / distance);
        }
        bounds(i, j) = std::max(bounds(i, j), ratio / (1 - kApproached));
      }
    }
  return bounds;
}

}  // namespace exmat::runtime
