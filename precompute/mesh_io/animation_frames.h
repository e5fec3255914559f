#pragma once

#include <Eigen/Geometry>
#include <set>
#include <string>
#include <vector>

#include "common/model/reduced_model.h"

namespace exmat::precompute {

inline constexpr double kLongestAnimation = 3600;  ///< [s]

/// The animations of a file with bones, as poses of all bones at times that are dense enough for straight lines.
class AnimationFrames {
 public:
  explicit AnimationFrames(std::size_t bones) : bones_(bones) {}

  /// Begins an animation. Returns the times of its frames [s]: 0, the keys, and 60 a second as far as the last key.
  /// `keys` are from 0 to kLongestAnimation [s]. Throws InputError with that place of the file where the poses of all
  /// animations are too many.
  std::vector<double> begin(const std::string& name, std::set<double> keys, const std::string& file,
                            const std::string& place);

  /// Adds the next bone of the next frame: its joint, world [m], and its turn from the bind pose. Frames and their
  /// bones come in order, as many as begin() has returned times.
  void add(const Eigen::Vector3d& joint, const Eigen::Quaterniond& turn);

  /// Sets names, frames, times and poses of the animations.
  void put_into(SkeletonData& data) const;

 private:
  std::size_t bones_;
  std::vector<std::string> names_;
  std::vector<std::int32_t> first_frames_{0};
  std::vector<double> times_, poses_;
};

}  // namespace exmat::precompute
