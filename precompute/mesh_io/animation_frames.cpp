#include "precompute/mesh_io/animation_frames.h"

#include <cmath>
#include <fmt/format.h>

#include "common/core/error.h"

namespace exmat::precompute {
namespace {

constexpr double kFrameRate = 60;     // of poses between keys [1/s]
constexpr double kMostNumbers = 2e7;  // of all poses

}  // namespace

std::vector<double> AnimationFrames::begin(const std::string& name, std::set<double> keys, const std::string& file,
                                           const std::string& place) {
  keys.insert(0);
  const auto frames = static_cast<int>(std::ceil(*keys.rbegin() * kFrameRate));
  for (int frame = 1; frame < frames; ++frame) keys.insert(frame / kFrameRate);
  std::vector<double> times;
  for (const double time : keys)
    if (times.empty() || time - times.back() > 1e-9) times.push_back(time);
  if (static_cast<double>((times_.size() + times.size()) * 7 * bones_) > kMostNumbers)
    throw InputError({file, place, fmt::format("at most {:g} numbers in the poses of all animations", kMostNumbers),
                      "more", "export fewer or shorter ones"});
  names_.push_back(name);
  times_.insert(times_.end(), times.begin(), times.end());
  first_frames_.push_back(static_cast<std::int32_t>(times_.size()));
  return times;
}

void AnimationFrames::add(const Eigen::Vector3d& joint, const Eigen::Quaterniond& turn) {
  poses_.insert(poses_.end(), {joint.x(), joint.y(), joint.z(), turn.w(), turn.x(), turn.y(), turn.z()});
}

void AnimationFrames::put_into(SkeletonData& data) const {
  data.animations = names_;
  data.first_frames = Eigen::Map<const IndexVector>(first_frames_.data(), std::ssize(first_frames_));
  data.times = Eigen::Map<const Eigen::VectorXd>(times_.data(), std::ssize(times_));
  data.poses = Eigen::Map<const RowMatrix>(poses_.data(), std::ssize(poses_) / 7, 7);
}

}  // namespace exmat::precompute
