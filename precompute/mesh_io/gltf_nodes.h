#pragma once

#include <Eigen/Geometry>
#include <functional>
#include <set>
#include <string>
#include <vector>

#include "precompute/mesh_io/gltf_document.h"

namespace exmat::precompute {

/// From a node to its parent. Throws InputError where that is no transform.
Eigen::Affine3d own_transform(const std::string& file, const tinygltf::Node& node, const std::string& place);

/// The name, or with the first number from 2 on that makes it another than those taken. Then it is taken.
std::string unique_name(const std::string& name, std::set<std::string>& taken);

/// Callbacks of a walk over nodes: each node with its transform to the scene, then its children, then its end.
struct NodeVisitor {
  std::function<void(int node, const Eigen::Affine3d& to_scene)> begin;
  std::function<void(int node)> end;
};

/// Walks over the nodes of the default scene, else of the first, else below all nodes that are no children. Throws
/// InputError where they are no trees or a transform is none.
void visit_nodes(const std::string& file, const tinygltf::Model& model, const NodeVisitor& visitor);

/// The same nodes as a tree.
struct NodeTree {
  std::vector<int> order;                 ///< parents before their children
  std::vector<int> parents;               ///< parent of each node of the file, -1 for roots and those left out
  std::vector<Eigen::Affine3d> to_scene;  ///< transform of each node of the file, the identity for those left out
};
NodeTree node_tree(const std::string& file, const tinygltf::Model& model);

}  // namespace exmat::precompute
