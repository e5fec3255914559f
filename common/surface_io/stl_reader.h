#pragma once

#include "common/surface_io/surface.h"

namespace exmat {

/// Reads a .stl file, binary or text, also a binary one that begins with "solid". Corners at the same position are one
/// vertex, in the order of their first appearance; normals are left out. The solids of a text are parts by their names.
/// Throws InputError with file, line or byte, expected and found.
SurfaceFile read_stl(const std::filesystem::path& file);

}  // namespace exmat
