#pragma once

#include <array>
#include <cstdint>
#include <string>

#include "common/core/arrays.h"

namespace exmat {

/// Faults that keep a surface from being the boundary of a solid: an edge of such a boundary belongs to two triangles,
/// which run along it in opposite directions.
struct SurfaceFaults {
  std::int64_t open = 0;                      ///< edges of one triangle
  std::int64_t turned = 0;                    ///< edges that both triangles run along the same way
  std::int64_t crowded = 0;                   ///< edges of three triangles and more
  std::array<std::int32_t, 2> first{-1, -1};  ///< vertices of the first of all these edges

  bool any() const { return open + turned + crowded > 0; }
  /// "3 edges of one triangle alone, the first between vertices 0 and 1, from 0" and the like.
  std::string words() const;
};
SurfaceFaults surface_faults(const TriangleArray& triangles);

/// Vertices at one place become the first of them there; triangles that lose a corner by it are left out.
void weld(const VertexArray& vertices, TriangleArray& triangles);

/// Volume inside closed triangles that face outward; negative where they face inward [m^3].
double enclosed_volume(const VertexArray& vertices, const TriangleArray& triangles);

/// Standard deviation of the vertices along the direction in which it is least [m].
double least_extent(const VertexArray& vertices);

/// True where all vertices lie in a plane, but for a millionth of their extent.
bool is_flat(const VertexArray& vertices);

}  // namespace exmat
