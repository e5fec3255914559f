#include "runtime/sim/frame/skeleton.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <utility>

#include "common/elastic/polar_rotation.h"

namespace exmat::runtime {

void BoneAnimation::sample(double time, BonePoses& poses) const noexcept {
  const auto after = std::ranges::upper_bound(times_, time);
  const auto last = static_cast<std::size_t>(std::max<std::ptrdiff_t>(0, after - times_.begin() - 1));
  const std::size_t next = std::min(last + 1, times_.size() - 1);
  const double span = times_[next] - times_[last];
  const double share = span > 0 ? std::clamp((time - times_[last]) / span, 0.0, 1.0) : 0;
  for (std::size_t b = 0; b < poses.size(); ++b) {
    const BonePose &from = poses_[last][b], &to = poses_[next][b];
    poses[b] = {from.joint + share * (to.joint - from.joint), from.turn.slerp(share, to.turn)};
  }
}

Skeleton::Skeleton(const SkeletonData& data) : names_(data.bones) {
  for (std::size_t b = 0; b < names_.size(); ++b) {
    const auto row = static_cast<Eigen::Index>(b);
    parents_.push_back(data.parents[row]);
    binds_.emplace_back(data.bind.middleRows(3 * row, 3));
    axes_.emplace_back(nearest_rotation(binds_.back().leftCols<3>()));
  }
  for (std::size_t a = 0; a < data.animations.size(); ++a) {
    std::vector<double> times;
    std::vector<BonePoses> poses;
    const auto at = static_cast<Eigen::Index>(a);
    for (Eigen::Index frame = data.first_frames[at]; frame < data.first_frames[at + 1]; ++frame) {
      times.push_back(data.times[frame]);
      BonePoses& pose = poses.emplace_back();
      for (Eigen::Index b = 0; b < std::ssize(names_); ++b) {
        const Eigen::VectorXd numbers = data.poses.row(frame * std::ssize(names_) + b);
        pose.push_back({numbers.head<3>(), Eigen::Quaterniond(numbers[3], numbers[4], numbers[5], numbers[6])});
      }
    }
    animations_.emplace_back(data.animations[a], std::move(times), std::move(poses));
  }
}

BonePoses Skeleton::bound() const {
  BonePoses poses;
  for (const BoneMatrix& bind : binds_) poses.push_back({bind.col(3), Eigen::Quaterniond::Identity()});
  return poses;
}

std::vector<std::size_t> Skeleton::branch(std::size_t bone) const {
  std::vector<std::size_t> found{bone};
  for (std::size_t next = 0; next < found.size(); ++next)
    for (std::size_t b = 0; b < size(); ++b)
      if (parents_[b] >= 0 && static_cast<std::size_t>(parents_[b]) == found[next]) found.push_back(b);
  return found;
}

Eigen::Quaterniond Skeleton::own_turn(std::size_t bone, const BonePoses& poses) const noexcept {
  const int parent = parents_[bone];
  Eigen::Quaterniond turn = poses[bone].turn;
  if (parent >= 0) turn = poses[static_cast<std::size_t>(parent)].turn.conjugate() * turn;
  return axes_[bone].conjugate() * turn * axes_[bone];
}

BonePose Skeleton::pose(std::size_t bone, const BoneMatrix& world) const noexcept {
  const Eigen::Matrix3d stretched = world.leftCols<3>() * binds_[bone].leftCols<3>().inverse();
  return {world.col(3), Eigen::Quaterniond(nearest_rotation(stretched))};
}

BoneMatrix Skeleton::matrix(std::size_t bone, const BonePose& pose) const noexcept {
  BoneMatrix world;
  world << pose.turn.toRotationMatrix() * binds_[bone].leftCols<3>(), pose.joint;
  return world;
}

const BoneAnimation* Skeleton::find_animation(const std::string& name) const noexcept {
  const auto found = std::ranges::find(animations_, name, &BoneAnimation::name);
  return found == animations_.end() ? nullptr : &*found;
}

void BonePlay::add_keys(const Skeleton& skeleton, std::size_t bone, const RigidMotion& motion) {
  BoneKeys own{skeleton.branch(bone), skeleton.axes(bone), motion};
  // A bone has a smaller branch than those that it hangs on.
  const auto size_of = [](const BoneKeys& other) { return other.branch.size(); };
  keys.insert(std::ranges::upper_bound(keys, size_of(own), {}, size_of), std::move(own));
}

void BonePlay::sample(double time, BonePoses& poses) const noexcept {
  if (animation != nullptr) {
    double at = start + speed * time;
    const double duration = animation->duration();
    if (loop && duration > 0) at -= duration * std::floor(at / duration);
    animation->sample(at, poses);
  } else {
    std::ranges::copy(bound, poses.begin());
  }
  // A bone is where the animation has it until those that it hangs on take it along.
  for (const BoneKeys& own : keys) {
    const MotionSample key = own.motion.sample(time);
    const BonePose bone = poses[own.branch.front()];
    const Eigen::Quaterniond axes = bone.turn * own.axes;
    const Eigen::Quaterniond turn = axes * Eigen::Quaterniond(key.rotation) * axes.conjugate();
    const Eigen::Vector3d joint = bone.joint + axes * key.position;
    for (const std::size_t b : own.branch)
      poses[b] = {joint + turn * (poses[b].joint - bone.joint), (turn * poses[b].turn).normalized()};
  }
}

}  // namespace exmat::runtime
