#include "runtime/viewer/simulation/joint_hand.h"

#include <Eigen/Geometry>
#include <vector>

namespace exmat::viewer {

void turn_toward(std::size_t joint, const Eigen::Vector3d& target, double share, std::span<const std::int64_t> parents,
                 std::span<double> transforms) {
  using Transform = Eigen::Matrix<double, 3, 4, Eigen::RowMajor>;
  const auto bone = [&](std::size_t b) { return Eigen::Map<Transform>(transforms.data() + 12 * b); };
  const bool is_root = parents[joint] < 0;
  const std::size_t top = is_root ? joint : static_cast<std::size_t>(parents[joint]);
  const Eigen::Vector3d pivot = bone(top).col(3), arm = bone(joint).col(3) - pivot, way = target - pivot;
  const Eigen::Vector3d shift = is_root ? Eigen::Vector3d(share * way) : Eigen::Vector3d::Zero();
  Eigen::Matrix3d turn = Eigen::Matrix3d::Identity();
  if (!arm.isZero(0) && !way.isZero(0))
    turn = Eigen::Quaterniond::Identity().slerp(share, Eigen::Quaterniond::FromTwoVectors(arm, way)).toRotationMatrix();
  std::vector<bool> goes_along(parents.size(), false);
  goes_along[top] = true;
  for (std::size_t b = top; b < parents.size(); ++b) {  // parents come first
    if (b > top && parents[b] >= 0) goes_along[b] = goes_along[static_cast<std::size_t>(parents[b])];
    if (!goes_along[b]) continue;
    auto moved = bone(b);
    moved.col(3) -= pivot;
    moved = (turn * moved).eval();
    moved.col(3) += pivot + shift;
  }
}

}  // namespace exmat::viewer
