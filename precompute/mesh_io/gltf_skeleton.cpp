#include "precompute/mesh_io/gltf_skeleton.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <fmt/format.h>

#include "common/elastic/polar_rotation.h"
#include "precompute/mesh_io/animation_frames.h"
#include "precompute/mesh_io/gltf_nodes.h"

namespace exmat::precompute {
namespace {

constexpr double kBeforeJump = 1e-4;  // [s] that a pose is held to before a step
constexpr double kSameBind = 1e-3;    // of the farthest joint, that skins may disagree by
constexpr double kStretch = 0.01;     // of a bone, that is reported
constexpr std::array<std::string_view, 3> kMoved{"translation", "rotation", "scale"};
constexpr std::array<std::string_view, 3> kWays{"LINEAR", "STEP", "CUBICSPLINE"};

std::string place_of(const char* list, std::size_t index) { return fmt::format("/{}/{}", list, index); }

// The rotation nearest to the turn of a bone, and how much it is stretched beside that.
Eigen::Quaterniond turn_of(const Eigen::Matrix3d& stretched, double& stretch) {
  const Eigen::Matrix3d turn = nearest_rotation(stretched);
  stretch = std::max(stretch, (turn.transpose() * stretched - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff());
  return Eigen::Quaterniond(turn);
}

}  // namespace

Eigen::VectorXd GltfSkeleton::Channel::at(double time) const {
  const bool cubic = way == "CUBICSPLINE";
  const auto key = [&](Eigen::Index k, int part) -> Eigen::VectorXd { return values.row(cubic ? 3 * k + part : k); };
  const auto* const after = std::upper_bound(times.data(), times.data() + times.size(), time);
  const Eigen::Index last = std::max<Eigen::Index>(0, after - times.data() - 1);
  if (time <= times[0] || last + 1 == times.size() || way == "STEP") return key(last, 1);
  const double span = times[last + 1] - times[last], s = (time - times[last]) / span;
  const Eigen::VectorXd from = key(last, 1), to = key(last + 1, 1);
  if (cubic) {
    const double s2 = s * s, s3 = s2 * s;
    return (2 * s3 - 3 * s2 + 1) * from + span * (s3 - 2 * s2 + s) * key(last, 2) + (3 * s2 - 2 * s3) * to +
           span * (s3 - s2) * key(last + 1, 0);
  }
  if (path != "rotation") return from + s * (to - from);
  const Eigen::Quaterniond start(from[3], from[0], from[1], from[2]), end(to[3], to[0], to[1], to[2]);
  return start.normalized().slerp(s, end.normalized()).coeffs();
}

GltfSkeleton::GltfSkeleton(const std::string& file, const GltfDocument& document, const GltfAccessors& accessors)
    : file_(file), model_(document.model), accessors_(accessors) {
  if (model_.skins.empty()) return;
  tree_ = node_tree(file_, model_);
  std::set<int> used;
  for (const int node : tree_.order) used.insert(model_.nodes[static_cast<std::size_t>(node)].skin);
  // Bones are numbered as the scene has them: parents come first.
  std::set<int> joints;
  for (std::size_t s = 0; s < model_.skins.size(); ++s)
    if (used.contains(static_cast<int>(s))) joints.insert(model_.skins[s].joints.begin(), model_.skins[s].joints.end());
  for (const int node : tree_.order)
    if (joints.contains(node)) {
      bone_of_[node] = joints_.size();
      joints_.push_back(node);
    }
  binds_.resize(joints_.size(), Eigen::Affine3d(Eigen::Matrix4d::Zero()));
  for (std::size_t s = 0; s < model_.skins.size(); ++s)
    skins_.push_back(used.contains(static_cast<int>(s)) ? read_skin(static_cast<int>(s)) : Skin{});
}

GltfSkeleton::Skin GltfSkeleton::read_skin(int index) {
  const tinygltf::Skin& source = model_.skins[static_cast<std::size_t>(index)];
  const std::string place = place_of("skins", static_cast<std::size_t>(index));
  if (source.joints.empty()) fail_in_gltf(file_, place + "/joints", "at least one joint", "none");
  std::vector<Eigen::Affine3d> inverses(source.joints.size(), Eigen::Affine3d::Identity());
  if (source.inverseBindMatrices >= 0) {
    const RowMatrix rows = accessors_.read_rows(source.inverseBindMatrices, TINYGLTF_TYPE_MAT4, "MAT4");
    if (rows.rows() < std::ssize(inverses))
      fail_in_gltf(file_, place + "/inverseBindMatrices", fmt::format("{} matrices", inverses.size()),
                   std::to_string(rows.rows()));
    for (std::size_t j = 0; j < inverses.size(); ++j) {
      const Eigen::RowVectorXd numbers = rows.row(static_cast<Eigen::Index>(j));
      inverses[j].matrix() = Eigen::Map<const Eigen::Matrix4d>(numbers.data());
      if (!(std::abs(inverses[j].linear().determinant()) > 1e-30))
        fail_in_gltf(file_, place + "/inverseBindMatrices", "matrices that can be inverted",
                     fmt::format("another for joint {}", j));
    }
  }
  Skin skin;
  std::size_t root = 0;
  for (std::size_t j = 0; j < source.joints.size(); ++j) {
    const auto bone = bone_of_.find(source.joints[j]);
    if (bone == bone_of_.end())
      fail_in_gltf(file_, fmt::format("{}/joints/{}", place, j), "a node of the scene",
                   fmt::format("node {}", source.joints[j]));
    skin.bones.push_back(bone->second);
    if (bone->second < skin.bones[root]) root = j;
  }
  skin.to_scene = tree_.to_scene[static_cast<std::size_t>(source.joints[root])] * inverses[root];
  for (std::size_t j = 0; j < inverses.size(); ++j)
    bind(skin.bones[j], skin.to_scene * inverses[j].inverse(), fmt::format("{}/inverseBindMatrices", place));
  return skin;
}

void GltfSkeleton::bind(std::size_t bone, const Eigen::Affine3d& to_scene, const std::string& place) {
  if (!(std::abs(to_scene.linear().determinant()) > 1e-30) || !to_scene.matrix().allFinite())
    fail_in_gltf(file_, place, "bones with axes", fmt::format("bone {} without", bone));
  Eigen::Affine3d& known = binds_[bone];
  if (known.linear().isZero(0)) {
    known = to_scene;
    return;
  }
  double size = 0;
  for (const Eigen::Affine3d& other : binds_)
    size = std::max(size, (other.translation() - to_scene.translation()).norm());
  if ((known.translation() - to_scene.translation()).norm() > kSameBind * size)
    fail_in_gltf(file_, place, "skins that are bound in one pose", "several",
                 "apply the pose of each armature as its rest pose, or export the skins as one");
}

std::optional<std::size_t> GltfSkeleton::bone_at_or_above(int node) const {
  if (empty()) return std::nullopt;
  for (; node >= 0; node = tree_.parents[static_cast<std::size_t>(node)])
    if (const auto found = bone_of_.find(node); found != bone_of_.end()) return found->second;
  return std::nullopt;
}

std::vector<Eigen::Affine3d> GltfSkeleton::transforms(const std::vector<tinygltf::Node>& nodes) const {
  std::vector<Eigen::Affine3d> result(nodes.size(), Eigen::Affine3d::Identity());
  for (const int node : tree_.order) {
    const auto index = static_cast<std::size_t>(node);
    const int parent = tree_.parents[index];
    const Eigen::Affine3d own = own_transform(file_, nodes[index], place_of("nodes", index));
    result[index] = parent < 0 ? own : result[static_cast<std::size_t>(parent)] * own;
  }
  return result;
}

SkeletonData GltfSkeleton::data(std::vector<std::string>& remarks) const {
  SkeletonData data;
  const auto count = static_cast<Eigen::Index>(size());
  data.parents.resize(count);
  data.bind.resize(3 * count, 4);
  std::set<std::string> taken;
  for (Eigen::Index b = 0; b < count; ++b) {
    const int node = joints_[static_cast<std::size_t>(b)];
    std::string name = model_.nodes[static_cast<std::size_t>(node)].name;
    if (name.empty()) name = fmt::format("bone {}", b);
    data.bones.push_back(unique_name(name, taken));
    const auto parent = bone_at_or_above(tree_.parents[static_cast<std::size_t>(node)]);
    data.parents[b] = parent ? static_cast<std::int32_t>(*parent) : -1;
    const Eigen::Affine3d& bind = binds_[static_cast<std::size_t>(b)];
    data.bind.middleRows(3 * b, 3) << bind.linear(), bind.translation();
  }
  add_animations(data, remarks);
  return data;
}

std::vector<GltfSkeleton::Channel> GltfSkeleton::read_channels(const tinygltf::Animation& animation,
                                                               const std::string& place) const {
  std::vector<Channel> channels;
  for (std::size_t c = 0; c < animation.channels.size(); ++c) {
    const tinygltf::AnimationChannel& from = animation.channels[c];
    const std::string at = fmt::format("{}/channels/{}", place, c);
    const auto node = static_cast<std::size_t>(from.target_node);
    if (from.target_node < 0 || std::ranges::count(kMoved, from.target_path) == 0) continue;
    if (node >= model_.nodes.size() || from.sampler < 0 ||
        static_cast<std::size_t>(from.sampler) >= animation.samplers.size())
      fail_in_gltf(file_, at, "a node and a sampler of the file", "others");
    if (!model_.nodes[node].matrix.empty())
      fail_in_gltf(file_, at, "a node of translation, rotation and scale", "one with a matrix");
    const tinygltf::AnimationSampler& sampler = animation.samplers[static_cast<std::size_t>(from.sampler)];
    if (std::ranges::count(kWays, sampler.interpolation) == 0)
      fail_in_gltf(file_, at, "LINEAR, STEP or CUBICSPLINE", sampler.interpolation);
    const bool turns = from.target_path == "rotation";
    Channel channel{
        node, from.target_path, sampler.interpolation, accessors_.read_scalars(sampler.input),
        accessors_.read_rows(sampler.output, turns ? TINYGLTF_TYPE_VEC4 : TINYGLTF_TYPE_VEC3, turns ? "VEC4" : "VEC3")};
    const Eigen::VectorXd& keys = channel.times;
    const Eigen::Index count = keys.size();
    if (count == 0 || channel.values.rows() != count * (channel.way == "CUBICSPLINE" ? 3 : 1))
      fail_in_gltf(file_, at, "a value for each time", fmt::format("{} for {}", channel.values.rows(), count));
    if ((keys.head(count - 1).array() >= keys.tail(count - 1).array()).any() || keys[0] < 0 ||
        keys[count - 1] > kLongestAnimation)
      fail_in_gltf(file_, at, fmt::format("times from 0 to {:g} s that ascend", kLongestAnimation), "others");
    channels.push_back(std::move(channel));
  }
  return channels;
}

std::set<double> GltfSkeleton::key_times(const std::vector<Channel>& channels) {
  std::set<double> times;
  for (const Channel& channel : channels)
    for (const double key : channel.times) {
      times.insert(key);
      if (channel.way == "STEP" && key > kBeforeJump) times.insert(key - kBeforeJump);
    }
  return times;
}

void GltfSkeleton::add_animations(SkeletonData& data, std::vector<std::string>& remarks) const {
  AnimationFrames frames(size());
  double stretch = 0;
  std::set<std::string> taken;
  for (std::size_t a = 0; a < model_.animations.size(); ++a) {
    const tinygltf::Animation& animation = model_.animations[a];
    const std::string place = place_of("animations", a);
    const std::vector<Channel> channels = read_channels(animation, place);
    const std::string name =
        unique_name(animation.name.empty() ? fmt::format("animation {}", a) : animation.name, taken);
    std::vector<tinygltf::Node> nodes = model_.nodes;
    for (const double time : frames.begin(name, key_times(channels), file_, place)) {
      for (const Channel& channel : channels) {
        tinygltf::Node& node = nodes[channel.node];
        auto& moved = channel.path == "rotation" ? node.rotation
                      : channel.path == "scale"  ? node.scale
                                                 : node.translation;
        const Eigen::VectorXd value = channel.at(time);
        moved.assign(value.begin(), value.end());
      }
      const std::vector<Eigen::Affine3d> to_scene = transforms(nodes);
      for (std::size_t b = 0; b < size(); ++b) {
        const Eigen::Affine3d& now = to_scene[static_cast<std::size_t>(joints_[b])];
        frames.add(now.translation(), turn_of((now * binds_[b].inverse()).linear(), stretch));
      }
    }
  }
  frames.put_into(data);
  if (stretch > kStretch)
    remarks.push_back(fmt::format("animations stretch bones by up to {:.0f} %, which is left out: bones turn and move",
                                  100 * stretch));
}

}  // namespace exmat::precompute
