#pragma once

#include <Eigen/Geometry>
#include <functional>
#include <string>

#include "precompute/mesh_io/gltf_document.h"

namespace exmat::precompute {

/// What a walk over nodes calls: each node with its transform to the scene, then its children, then its end.
struct NodeVisitor {
  std::function<void(int node, const Eigen::Affine3d& to_scene)> begin;
  std::function<void(int node)> end;
};

/// Walks over the nodes of the default scene, else of the first, else below all nodes that are no children. Throws
/// InputError where they are no trees or a transform is none.
void visit_nodes(const std::string& file, const tinygltf::Model& model, const NodeVisitor& visitor);

}  // namespace exmat::precompute
