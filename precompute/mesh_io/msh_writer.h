#pragma once

#include <filesystem>

#include "common/mesh/tet_mesh.h"

namespace exmat::precompute {

/// Writes a mesh as Gmsh 2.2 text, which read_mesh reads back to the last bit. Throws WorkError; `file` is then as it
/// was.
void write_msh(const TetMesh& mesh, const std::filesystem::path& file);

}  // namespace exmat::precompute
