#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "common/mesh/tet_mesh.h"

namespace exmat::precompute {

/// Contents of a mesh file, unchecked (see common/mesh/checks.h), indices 0-based.
struct MeshFile {
  TetMesh mesh;
  std::optional<TetMaterials> materials;  ///< per tet, where the file gives every tet a material
  std::map<std::string, std::vector<std::int32_t>> vertex_sets, tet_sets;
  std::vector<std::filesystem::path> files;  ///< every file that was read, the named one first
};

/// Reads by extension: .veg (Vega, with *INCLUDE, *MATERIAL ENU, *SET, *REGION), .msh (Gmsh 2.2 and 4.1, ASCII and
/// binary), .node or .ele (TetGen, both of the pair), .mesh (MEDIT, ASCII), .vtk (legacy unstructured grids, ASCII and
/// binary). Throws InputError with file, line (or byte offset in binary parts), expected and found.
MeshFile read_mesh(const std::filesystem::path& file);

}  // namespace exmat::precompute
