#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "common/core/arrays.h"

namespace exmat::precompute {

/// The look of a surface, and which of its vertices each of p primitives has.
struct SurfaceLook {
  std::string glb;       ///< a file by itself: nodes, meshes, materials, textures and their images
  IndexVector vertices;  ///< p, the first vertex of each primitive of each of its meshes, in their order
  RowMatrix frames;      ///< 3p x 3, linear part of the transform from the primitive's mesh to the surface
  std::vector<std::filesystem::path> images;  ///< files that were read besides those of the surface
  std::vector<std::string> remarks;           ///< notes to the user, a sentence each
};

/// Reads how the surface of a glTF file looks, lengths times `unit`. The attributes NORMAL, TEXCOORD_n, COLOR_n
/// and custom ones stay as they are, as do names, extras, materials and textures. Each node has a mesh of its own.
/// Images of files and of data URIs become part of it; one that is not in the file's folder or below keeps its URI.
/// Left out are tangents, which would have to move, morph targets, animations, cameras and lights, and attributes that
/// are not sound, with a remark. Nothing where the file has one mesh with neither materials nor texture coordinates nor
/// colours, or where a node's transform flattens its mesh. Throws InputError (see read_gltf).
std::optional<SurfaceLook> read_gltf_look(const std::filesystem::path& file, double unit);

}  // namespace exmat::precompute
