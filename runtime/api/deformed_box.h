#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "runtime/api/point_set.h"

namespace exmat::runtime {

/// A box around points that move by the modes, at any displacement and without their positions: no mode moves one of
/// them farther along an axis than its largest entry there. Frame of the body.
class DeformedBox {
 public:
  DeformedBox() = default;
  explicit DeformedBox(const PointSet& points);

  /// Holds every point X + U q, up to rounding [m].
  Eigen::AlignedBox3d at(const Eigen::VectorXd& q) const noexcept;

 private:
  Eigen::AlignedBox3d rest_;
  Eigen::Matrix3Xd farthest_;  // [3 x r], of |U| by axis
};

}  // namespace exmat::runtime
