#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <vector>

#include "common/core/arrays.h"

namespace exmat::precompute {

/// A surface as a file draws it: to be moved with a body, not to be computed with.
struct SurfaceMesh {
  VertexArray vertices;     ///< n x 3, all of the file's, in its order
  TriangleArray triangles;  ///< n_f x 3, indices into vertices
};

/// Reads by extension: .obj (Wavefront), .ply (text and binary). Polygons become fans of triangles about their first
/// corner. Throws InputError with file, line (or byte in binary parts), expected and found.
SurfaceMesh read_surface(const std::filesystem::path& file);

/// Appends the triangles of a polygon of at least three corners.
void add_fan(const std::vector<std::int32_t>& polygon, std::vector<std::array<std::int32_t, 3>>& triangles);

}  // namespace exmat::precompute
