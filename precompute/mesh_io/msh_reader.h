#pragma once

#include "precompute/mesh_io/mesh_file.h"

namespace exmat::precompute {

/// Reads Gmsh's .msh 2.2 and 4.1, text or binary in either byte order (gmsh.info/doc/texinfo/gmsh.html, "MSH file
/// format"). Vertices are all nodes in the order of the file; tets are the elements of type 4. Physical volumes become
/// tet_sets, by name or, where they have none, by number. Elements of other types are left out, volumes among them with
/// a warning; second-order tets and partitioned or parametric 2.2 meshes are refused. Throws InputError with file, line
/// or byte, expected and found.
MeshFile read_msh(const std::filesystem::path& file);

}  // namespace exmat::precompute
