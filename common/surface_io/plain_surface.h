#pragma once

#include "common/surface_io/surface.h"

namespace exmat {

/// Reads the triangles of an .obj, .ply or .stl file, by its extension: what needs no other library. Throws InputError
/// with file, line or byte, expected and found.
SurfaceFile read_plain_surface(const std::filesystem::path& file);

}  // namespace exmat
