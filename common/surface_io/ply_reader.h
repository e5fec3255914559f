#pragma once

#include "common/surface_io/surface.h"

namespace exmat {

/// Reads the vertices and faces of a .ply file, text or binary in either byte order (Turk 1994, "The PLY polygon file
/// format"). Colours are the properties red, green and blue of the vertices, integers in parts of the largest of their
/// type (255 of uchar), reals as they are, all cut off at 0 and 1. Other elements and properties are left out. Throws
/// InputError with file, line or byte, expected and found.
SurfaceFile read_ply(const std::filesystem::path& file);

}  // namespace exmat
