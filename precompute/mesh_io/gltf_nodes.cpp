#include "precompute/mesh_io/gltf_nodes.h"

#include <algorithm>
#include <fmt/format.h>
#include <optional>
#include <vector>

namespace exmat::precompute {
namespace {

std::string place_of_node(int node) { return fmt::format("/nodes/{}", node); }

class Walk {
 public:
  Walk(const std::string& file, const tinygltf::Model& model, const NodeVisitor& visitor)
      : file_(file), model_(model), visitor_(visitor), seen_(model.nodes.size()) {}

  void run() {
    for (const int root : roots()) {
      push(root, "/scenes", Eigen::Affine3d::Identity());
      while (!steps_.empty()) step();
    }
  }

 private:
  // A visit of a node: its begin, or its end after all that is below it.
  struct Step {
    int node;
    std::optional<Eigen::Affine3d> to_scene;
  };

  std::vector<int> roots() const {
    if (!model_.scenes.empty()) {
      const auto scene = static_cast<std::size_t>(std::max(model_.defaultScene, 0));
      if (scene >= model_.scenes.size())
        fail_in_gltf(file_, "/scene", fmt::format("a scene below {}", model_.scenes.size()), std::to_string(scene));
      return model_.scenes[scene].nodes;
    }
    std::vector<char> is_child(model_.nodes.size());
    for (const tinygltf::Node& node : model_.nodes)
      for (const int child : node.children)
        if (static_cast<std::size_t>(child) < is_child.size()) is_child[static_cast<std::size_t>(child)] = 1;
    std::vector<int> found;
    for (std::size_t node = 0; node < is_child.size(); ++node)
      if (!is_child[node]) found.push_back(static_cast<int>(node));
    return found;
  }

  void push(int node, const std::string& place, const Eigen::Affine3d& parent) {
    const auto index = static_cast<std::size_t>(node);
    if (node < 0 || index >= seen_.size())
      fail_in_gltf(file_, place, fmt::format("a node below {}", seen_.size()), std::to_string(node));
    if (seen_[index])
      fail_in_gltf(file_, place, "nodes that are trees", fmt::format("node {} twice", node),
                   "a node may be no child of itself or of two");
    seen_[index] = 1;
    steps_.push_back({node, parent * own_transform(file_, model_.nodes[index], place_of_node(node))});
  }

  void step() {
    const Step current = steps_.back();
    steps_.pop_back();
    if (!current.to_scene) {
      visitor_.end(current.node);
      return;
    }
    visitor_.begin(current.node, *current.to_scene);
    steps_.push_back({current.node, {}});
    const auto& children = model_.nodes[static_cast<std::size_t>(current.node)].children;
    for (auto child = children.rbegin(); child != children.rend(); ++child)
      push(*child, place_of_node(current.node) + "/children", *current.to_scene);
  }

  const std::string& file_;
  const tinygltf::Model& model_;
  const NodeVisitor& visitor_;
  std::vector<char> seen_;
  std::vector<Step> steps_;
};

}  // namespace

Eigen::Affine3d own_transform(const std::string& file, const tinygltf::Node& node, const std::string& place) {
  Eigen::Affine3d transform = Eigen::Affine3d::Identity();
  if (!node.matrix.empty()) {
    transform.matrix() = Eigen::Map<const Eigen::Matrix4d>(node.matrix.data());
    if (transform.matrix().row(3) != Eigen::RowVector4d(0, 0, 0, 1))
      fail_in_gltf(file, place + "/matrix", "a last row of 0 0 0 1", "another");
    return transform;
  }
  if (!node.translation.empty()) transform.translate(Eigen::Vector3d(node.translation.data()));
  if (!node.rotation.empty()) {
    Eigen::Quaterniond rotation;
    rotation.coeffs() = Eigen::Vector4d(node.rotation.data());
    const double norm = rotation.norm();
    if (!(norm > 1e-6 && norm < 1e6))
      fail_in_gltf(file, place + "/rotation", "a unit quaternion", fmt::format("one of length {:.6g}", norm));
    transform.rotate(rotation.normalized());
  }
  if (!node.scale.empty()) transform.scale(Eigen::Vector3d(node.scale.data()));
  return transform;
}

std::string unique_name(const std::string& name, std::set<std::string>& taken) {
  std::string unique = name;
  for (int number = 2; !taken.insert(unique).second; ++number) unique = fmt::format("{} {}", name, number);
  return unique;
}

void visit_nodes(const std::string& file, const tinygltf::Model& model, const NodeVisitor& visitor) {
  Walk(file, model, visitor).run();
}

NodeTree node_tree(const std::string& file, const tinygltf::Model& model) {
  NodeTree tree{{},
                std::vector<int>(model.nodes.size(), -1),
                std::vector<Eigen::Affine3d>(model.nodes.size(), Eigen::Affine3d::Identity())};
  std::vector<int> above;
  visit_nodes(file, model,
              {[&](int node, const Eigen::Affine3d& to_scene) {
                 const auto index = static_cast<std::size_t>(node);
                 tree.order.push_back(node);
                 tree.to_scene[index] = to_scene;
                 if (!above.empty()) tree.parents[index] = above.back();
                 above.push_back(node);
               },
               [&](int) { above.pop_back(); }});
  return tree;
}

}  // namespace exmat::precompute
