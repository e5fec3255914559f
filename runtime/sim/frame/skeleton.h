#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <string>
#include <vector>

#include "common/model/reduced_model.h"
#include "runtime/sim/frame/motion.h"

namespace exmat::runtime {

/// Joint of a bone, world [m], and the bone's rotation since it was bound.
struct BonePose {
  Eigen::Vector3d joint = Eigen::Vector3d::Zero();
  Eigen::Quaterniond turn = Eigen::Quaterniond::Identity();
};
using BonePoses = std::vector<BonePose>;

using BoneMatrix = Eigen::Matrix<double, 3, 4>;  ///< bone to world: axes and joint [m]

/// A motion of all bones of a skeleton through poses at ascending times, the first 0; between them joints go straight
/// and bones turn at a constant rate.
class BoneAnimation {
 public:
  BoneAnimation(std::string name, std::vector<double> times, std::vector<BonePoses> poses)
      : name_(std::move(name)), times_(std::move(times)), poses_(std::move(poses)) {}

  const std::string& name() const { return name_; }
  double duration() const { return times_.back(); }  ///< [s]
  /// Held at the ends. Poses are sized.
  void sample(double time, BonePoses& poses) const noexcept;

 private:
  std::string name_;
  std::vector<double> times_;
  std::vector<BonePoses> poses_;
};

/// The bones that a body hangs on. Immutable.
class Skeleton {
 public:
  explicit Skeleton(const SkeletonData& data);

  std::size_t size() const { return names_.size(); }
  const std::vector<std::string>& names() const { return names_; }
  int parent(std::size_t bone) const { return parents_[bone]; }  ///< -1 of a root
  const BoneMatrix& bind(std::size_t bone) const { return binds_[bone]; }
  const Eigen::Quaterniond& axes(std::size_t bone) const { return axes_[bone]; }  ///< to the world, where it is bound
  BonePoses bound() const;
  /// The bone and all that hang on it, itself first.
  std::vector<std::size_t> branch(std::size_t bone) const;
  /// Rotation of a bone against its parent since both were bound, in the bone's axes.
  Eigen::Quaterniond own_turn(std::size_t bone, const BonePoses& poses) const noexcept;
  /// Pose of a bone whose axes and joint are here; stretched axes give the nearest rotation.
  BonePose pose(std::size_t bone, const BoneMatrix& world) const noexcept;
  BoneMatrix matrix(std::size_t bone, const BonePose& pose) const noexcept;  ///< inverse of pose(), unstretched

  const std::vector<BoneAnimation>& animations() const { return animations_; }
  const BoneAnimation* find_animation(const std::string& name) const noexcept;  ///< null where none has the name

 private:
  std::vector<std::string> names_;
  std::vector<int> parents_;
  std::vector<BoneMatrix> binds_;
  std::vector<Eigen::Quaterniond> axes_;
  std::vector<BoneAnimation> animations_;
};

/// A bone that moves in its own axes beside what else moves it, and all that hang on it with it.
struct BoneKeys {
  std::vector<std::size_t> branch;                           ///< Skeleton::branch()
  Eigen::Quaterniond axes = Eigen::Quaterniond::Identity();  ///< Skeleton::axes() of the bone
  RigidMotion motion;
};

/// Motion that a body's bones follow: an animation, which outlives it, at `start` [s] of it at time 0, `speed` times as
/// fast, or none; and keys of single bones on top of it.
struct BonePlay {
  const BoneAnimation* animation = nullptr;
  double speed = 1;
  double start = 0;
  bool loop = true;
  BonePoses bound{};             ///< poses where there is no animation
  std::vector<BoneKeys> keys{};  ///< a bone before those that it hangs on

  /// Adds keys of a bone of the skeleton, which has none yet.
  void add_keys(const Skeleton& skeleton, std::size_t bone, const RigidMotion& motion);
  void sample(double time, BonePoses& poses) const noexcept;
};

}  // namespace exmat::runtime
