#pragma once

#include "precompute/mesh_io/surface_file.h"

namespace exmat::precompute {

/// Reads the vertices and faces of a .ply file, text or binary in either byte order (Turk 1994, "The PLY polygon file
/// format"). Other elements and properties are left out. Throws InputError with file, line or byte, expected and found.
SurfaceMesh read_ply(const std::filesystem::path& file);

}  // namespace exmat::precompute
