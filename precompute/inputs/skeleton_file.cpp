#include "precompute/inputs/skeleton_file.h"

#include <algorithm>
#include <fmt/format.h>
#include <numeric>
#include <set>
#include <string>
#include <vector>

#include "common/config/json_file.h"
#include "common/config/json_values.h"
#include "common/config/motion_reader.h"
#include "common/core/error.h"
#include "common/core/nearest_name.h"
#include "precompute/mesh_io/animation_frames.h"
#include "runtime/sim/frame/skeleton.h"

namespace exmat::precompute {
namespace {

class SkeletonReader {
 public:
  SkeletonReader(const std::filesystem::path& file, Eigen::Index vertices) : file_(file), vertices_(vertices) {}

  SkeletonData read(const Json& json) {
    read_joints(json["joints"]);
    read_weights(json["weights"]);
    read_animations(member_or(json, "animations", Json::array()));
    return std::move(data_);
  }

 private:
  void read_joints(const Json& json);
  void read_weights(const Json& json);
  void read_animations(const Json& json);
  std::vector<std::size_t> parents_first(const Json& json, const std::vector<std::string>& names) const;

  std::size_t find(const std::string& name, const std::vector<std::string>& names, const std::string& place) const {
    const auto found = std::ranges::find(names, name);
    if (found != names.end()) return static_cast<std::size_t>(found - names.begin());
    const std::string meant = nearest_name(name, names);
    refuse(place, "the name of a joint", fmt::format("\"{}\"", name),
           meant.empty() ? "" : fmt::format("did you mean \"{}\"?", meant));
  }

  /// The bone that an entry of a list names, which no entry before it does.
  std::size_t take_joint(const Json& entry, const std::string& place, std::set<std::size_t>& taken) const {
    const std::string name = entry["joint"];
    const std::size_t bone = find(name, data_.bones, place + "/joint");
    if (!taken.insert(bone).second) refuse(place + "/joint", "each joint once", fmt::format("\"{}\" again", name));
    return bone;
  }

  void refuse_repeated(const std::string& name, std::set<std::string>& taken, const std::string& place) const {
    if (!taken.insert(name).second) refuse(place + "/name", "each name once", fmt::format("\"{}\" again", name));
  }

  [[noreturn]] void refuse(const std::string& place, const std::string& expected, const std::string& found,
                           const std::string& advice = "") const {
    throw InputError({file_.string(), place, expected, found, advice});
  }

  std::filesystem::path file_;
  Eigen::Index vertices_;
  SkeletonData data_;
};

/// Numbers of the joints in the file, ordered so that each follows the one that it hangs on.
std::vector<std::size_t> SkeletonReader::parents_first(const Json& json, const std::vector<std::string>& names) const {
  std::vector<std::size_t> parents, depths, order(names.size());
  for (std::size_t i = 0; i < names.size(); ++i)
    parents.push_back(json[i].contains("parent") ? find(json[i]["parent"], names, fmt::format("/joints/{}/parent", i))
                                                 : names.size());
  for (std::size_t i = 0; i < names.size(); ++i) {
    std::size_t depth = 0;
    for (std::size_t above = i; parents[above] < names.size(); above = parents[above])
      if (++depth > names.size())
        refuse(fmt::format("/joints/{}/parent", above), "parents that end at a root",
               fmt::format("\"{}\", which hangs on itself", names[above]));
    depths.push_back(depth);
  }
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::ranges::stable_sort(order, {}, [&](std::size_t i) { return depths[i]; });
  return order;
}

void SkeletonReader::read_joints(const Json& json) {
  std::vector<std::string> names;
  std::set<std::string> taken;
  for (std::size_t i = 0; i < json.size(); ++i) {
    names.push_back(json[i]["name"]);
    refuse_repeated(names.back(), taken, fmt::format("/joints/{}", i));
  }
  data_.parents.resize(std::ssize(names));
  data_.bind.resize(3 * std::ssize(names), 4);
  for (const std::size_t i : parents_first(json, names)) {
    const auto bone = std::ssize(data_.bones);
    const std::string place = fmt::format("/joints/{}", i);
    data_.bind.middleRows(3 * bone, 3) << read_orientation(json[i], file_, place).toRotationMatrix(),
        read_vector(json[i]["position"]);
    data_.parents[bone] = json[i].contains("parent")
                              ? static_cast<std::int32_t>(find(json[i]["parent"], data_.bones, place + "/parent"))
                              : -1;
    data_.bones.push_back(names[i]);
  }
}

void SkeletonReader::read_weights(const Json& json) {
  data_.weights.setZero(vertices_, std::ssize(data_.bones));
  std::set<std::size_t> taken;
  std::set<std::int64_t> listed;
  for (std::size_t i = 0; i < json.size(); ++i) {
    const std::string place = fmt::format("/weights/{}", i);
    const auto bone = static_cast<Eigen::Index>(take_joint(json[i], place, taken));
    const std::vector<std::int64_t> ids = read_ids(json[i]["vertices"], file_, place + "/vertices");
    const auto weights =
        optional_member<std::vector<double>>(json[i], "weights").value_or(std::vector<double>(ids.size(), 1.0));
    if (weights.size() != ids.size())
      refuse(place + "/weights", fmt::format("{} numbers, one for each vertex", ids.size()),
             std::to_string(weights.size()));
    for (std::size_t k = 0; k < ids.size(); ++k) {
      if (ids[k] >= vertices_)
        refuse(fmt::format("{}/vertices/{}", place, k), fmt::format("vertices of the mesh, 0 to {}", vertices_ - 1),
               std::to_string(ids[k]));
      data_.weights(ids[k], bone) = weights[k];
    }
    listed.insert(ids.begin(), ids.end());
  }
  for (const std::int64_t vertex : listed) {
    const double sum = data_.weights.row(vertex).sum();
    if (!(sum > 0))
      refuse("/weights", "a weight above 0 for each vertex that is listed", fmt::format("none for vertex {}", vertex));
    data_.weights.row(vertex) /= sum;
  }
}

void SkeletonReader::read_animations(const Json& json) {
  const runtime::Skeleton skeleton(data_);
  AnimationFrames frames(skeleton.size());
  std::set<std::string> taken;
  for (std::size_t a = 0; a < json.size(); ++a) {
    const std::string place = fmt::format("/animations/{}", a);
    refuse_repeated(json[a]["name"], taken, place);
    runtime::BonePlay play{.bound = skeleton.bound()};
    std::set<std::size_t> moved;
    std::set<double> times;
    for (std::size_t i = 0; i < json[a]["bones"].size(); ++i) {
      const Json& own = json[a]["bones"][i];
      const std::string here = fmt::format("{}/bones/{}", place, i);
      const std::size_t bone = take_joint(own, here, moved);
      std::vector<runtime::Keyframe> keys;
      for (const KeyframeConfig& key : read_motion(own["motion"], file_, here + "/motion")) {
        keys.push_back({key.time, key.position, key.orientation});
        times.insert(key.time);
      }
      play.add_keys(skeleton, bone, runtime::RigidMotion(keys));
    }
    runtime::BonePoses poses = skeleton.bound();
    for (const double time : frames.begin(json[a]["name"], times, file_.string(), place)) {
      play.sample(time, poses);
      for (const runtime::BonePose& pose : poses) frames.add(pose.joint, pose.turn);
    }
  }
  frames.put_into(data_);
}

}  // namespace

SkeletonData read_skeleton(const std::filesystem::path& file, Eigen::Index vertices) {
  const Json json = read_json(file);
  check_against_schema(json, "skeleton", file);
  check_numbers(json, file);
  return SkeletonReader(file, vertices).read(json);
}

}  // namespace exmat::precompute
