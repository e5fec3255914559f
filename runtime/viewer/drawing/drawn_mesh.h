#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace exmat::viewer {

/// A triangle mesh as it is drawn: where it is sharp at rest a point has several normals. k points, m >= k corners.
struct DrawnMesh {
  std::vector<std::uint32_t> points;   ///< m, the point of each corner
  std::vector<std::uint32_t> indices;  ///< 3f, corners of the triangles
  std::vector<std::uint32_t> edges;    ///< 2e, corners of each edge, once
  std::vector<std::uint32_t> starts;   ///< m + 1, in `around`
  std::vector<std::uint32_t> around;   ///< the triangles that a corner's normal is the mean of
};

/// Mesh of triangles [3f] of points at `rest` [3k]; edges sharper than `crease` [rad] stay sharp.
DrawnMesh make_drawn_mesh(std::span<const double> rest, std::span<const std::int32_t> triangles, double crease = 0.75);

}  // namespace exmat::viewer
