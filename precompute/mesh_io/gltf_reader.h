#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <optional>
#include <vector>

#include "precompute/mesh_io/gltf_document.h"
#include "precompute/mesh_io/surface_file.h"

namespace exmat::precompute {

/// Reads the shapes of a glTF 2.0 file, .glb or .gltf with its buffers: all triangles (lists, strips, fans) of the
/// meshes in the nodes of the default scene, in metres, in the order of the nodes; without scenes those of all roots.
/// Primitives of a mesh that share their attributes share their vertices; a mesh in several nodes is there several
/// times. Morph targets keep the names of `extras.targetNames`, else they are "target 0" and so on. Parts are the
/// triangles' vertices of materials, meshes and nodes (with what hangs below them), and vertices whose custom scalar
/// attribute is above 0.5, by its name with the underscore. Vertices without colours are white where others have some.
///
/// The mesh of a file with skins is where its bones were bound, on a skeleton; what has no skin hangs on the
/// bone above it.
///
/// Throws InputError (see read_gltf_document), also for nodes that are no tree and for shapes that repeat
/// what is in the file so often that they are out of proportion to its bytes.
SurfaceFile read_gltf(const std::filesystem::path& file);

/// Place of a primitive's vertices among those of a surface.
struct DrawnPrimitive {
  int node = 0;
  std::size_t primitive = 0;               ///< index in the node's mesh
  Eigen::Index first = 0;                  ///< vertex; the others follow in the order of the primitive's accessors
  Eigen::Matrix3d to_scene;                ///< linear part of the node's transform, of a mesh with a skin of `bound`
  std::optional<Eigen::Affine3d> bound{};  ///< from a mesh with a skin to the scene
};

/// The same with what it was read from. Primitives of triangles alone, in the order of the nodes.
struct GltfShapes {
  SurfaceFile surface;
  GltfDocument document;
  std::vector<DrawnPrimitive> primitives;
};
GltfShapes read_gltf_shapes(const std::filesystem::path& file);

}  // namespace exmat::precompute
