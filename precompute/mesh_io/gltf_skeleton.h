#pragma once

#include <Eigen/Geometry>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "common/model/reduced_model.h"
#include "precompute/mesh_io/gltf_accessor.h"
#include "precompute/mesh_io/gltf_nodes.h"

namespace exmat::precompute {

/// The bones of a glTF file: the joints of all its skins, once each, and how its animations move them. Refers to the
/// document and the accessors. Faults are InputErrors of the JSON pointer.
class GltfSkeleton {
 public:
  GltfSkeleton(const std::string& file, const GltfDocument& document, const GltfAccessors& accessors);

  bool empty() const { return joints_.empty(); }
  std::size_t size() const { return joints_.size(); }
  std::size_t joints(int skin) const { return at(skin).bones.size(); }
  std::size_t bone(int skin, std::size_t joint) const { return at(skin).bones[joint]; }
  /// The bone that a node is or hangs on, else the first.
  std::size_t bone_above(int node) const { return bone_at_or_above(node).value_or(0); }
  /// From where the vertices of a mesh with this skin are to where they are bound in the scene, which is where the
  /// first joint of the skin stands: the node of such a mesh counts for nothing.
  const Eigen::Affine3d& to_scene(int skin) const { return at(skin).to_scene; }

  /// All but the weights.
  SkeletonData data(std::vector<std::string>& remarks) const;

 private:
  struct Skin {
    std::vector<std::size_t> bones;
    Eigen::Affine3d to_scene;
  };
  // A node and its way through an animation.
  struct Channel {
    std::size_t node;
    std::string path, way;
    Eigen::VectorXd times;
    RowMatrix values;
    Eigen::VectorXd at(double time) const;  // by the three ways of glTF 2.0
  };
  const Skin& at(int skin) const { return skins_[static_cast<std::size_t>(skin)]; }
  std::optional<std::size_t> bone_at_or_above(int node) const;
  Skin read_skin(int index);
  void bind(std::size_t bone, const Eigen::Affine3d& to_scene, const std::string& place);
  std::vector<Eigen::Affine3d> transforms(const std::vector<tinygltf::Node>& nodes) const;
  void add_animations(SkeletonData& data, std::vector<std::string>& remarks) const;
  std::vector<Channel> read_channels(const tinygltf::Animation& animation, const std::string& place) const;
  static std::set<double> key_times(const std::vector<Channel>& channels);

  const std::string& file_;
  const tinygltf::Model& model_;
  const GltfAccessors& accessors_;
  NodeTree tree_;
  std::vector<int> joints_;  // node of each bone
  std::map<int, std::size_t> bone_of_;
  std::vector<Eigen::Affine3d> binds_;  // of bones in the scene
  std::vector<Skin> skins_;
};

}  // namespace exmat::precompute
