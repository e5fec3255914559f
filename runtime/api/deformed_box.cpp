#include "runtime/api/deformed_box.h"

namespace exmat::runtime {

DeformedBox::DeformedBox(const PointSet& points) : farthest_(Eigen::Matrix3Xd::Zero(3, points.basis_rows.cols())) {
  for (Eigen::Index i = 0; i < points.rest.rows(); ++i) {
    rest_.extend(points.rest.row(i).transpose());
    farthest_ = farthest_.cwiseMax(points.basis_rows.middleRows<3>(3 * i).cwiseAbs());
  }
}

Eigen::AlignedBox3d DeformedBox::at(const Eigen::VectorXd& q) const noexcept {
  constexpr double kShareOfSlack = 1e-9;  // of the size, far above the rounding of sums over the modes
  const Eigen::Vector3d way = farthest_.lazyProduct(q.cwiseAbs());
  const double slack = kShareOfSlack * (rest_.diagonal() + way).norm();
  return {rest_.min() - way - Eigen::Vector3d::Constant(slack), rest_.max() + way + Eigen::Vector3d::Constant(slack)};
}

}  // namespace exmat::runtime
