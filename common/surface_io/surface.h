#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "common/core/arrays.h"
#include "common/model/reduced_model.h"

namespace exmat {

/// A surface as a file draws it: to be moved with a body, not to be computed with.
struct SurfaceMesh {
  VertexArray vertices;     ///< n x 3, all of the file's, in its order
  TriangleArray triangles;  ///< n_f x 3, indices into vertices
};

/// A shape of a surface that its file gives by name.
struct MorphTarget {
  std::string name;
  VertexArray positions;  ///< n x 3, all vertices where the target's weight is 1 and the others' 0
};

/// All that is read of a surface's file.
struct SurfaceFile {
  SurfaceMesh mesh;                          ///< all primitives, meshes and nodes as one, the nodes' transforms applied
  std::vector<MorphTarget> morphs;           ///< in the file's order; those of a name that several meshes have are one
  std::map<std::string, FlagVector> parts;   ///< n flags each: the vertices of what the file names
  std::optional<SkeletonData> skeleton;      ///< bones of a skin, with weights of the vertices where it is bound
  VertexArray colours;                       ///< n x 3 in 0 to 1: red, green, blue; no rows where there are none
  std::vector<std::filesystem::path> files;  ///< every file that was read, the named one first
  std::vector<std::string> remarks;          ///< notes to a user on how the file was read, a sentence each
  std::vector<std::string> warnings;         ///< likewise, of what is hardly meant
};

}  // namespace exmat
