#pragma once

#include "common/surface_io/surface.h"

namespace exmat {

/// Reads the vertices and faces of a Wavefront .obj file (paulbourke.net/dataformats/obj). Indices count from 1, or
/// backwards from the last vertex before them where they are negative. Parts are what `o`, `g` (each of its names) and
/// `usemtl` name. Indices of textures and normals, and all other statements are left out. Throws InputError with file,
/// line, expected and found.
SurfaceFile read_obj(const std::filesystem::path& file);

}  // namespace exmat
