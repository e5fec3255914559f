#pragma once

#include <Eigen/Core>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "common/core/arrays.h"
#include "common/model/reduced_model.h"

namespace exmat::runtime {

/// A primitive of triangles of a look.
struct LookPrimitive {
  Eigen::Index first = 0, count = 0;  ///< vertices of the surface, in the order of the primitive's accessors
  Eigen::Matrix3d frame;              ///< from displacements in its mesh to those of the surface, not singular
};

/// The look of a surface as its own glTF file has it: materials, textures, texture coordinates, colours, normals,
/// names. Each of its nodes that is drawn has a mesh of its own.
struct SurfaceLook {
  nlohmann::json document;
  std::string buffer;                     ///< the one that its views are of
  std::vector<LookPrimitive> primitives;  ///< primitives of all its meshes, in their order
  VertexArray normals;                    ///< v x 3, unit ones of the surface, 0 where it has none
};

/// Reads the look of a render mesh of v vertices, which has one. Throws InputError that names the bundle.
SurfaceLook read_look(const std::string& bundle, const RenderData& render);

}  // namespace exmat::runtime
