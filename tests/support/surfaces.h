#pragma once

#include <cmath>
#include <cstdint>
#include <numbers>
#include <vector>

#include "common/mesh/geometry.h"
#include "common/surface_io/surface.h"
#include "tests/support/box_mesh.h"

namespace exmat::test {

/// The surface of a mesh, with its own vertices alone.
inline SurfaceMesh boundary(const TetMesh& mesh) {
  SurfaceMesh surface{{}, surface_triangles(mesh.tets)};
  std::vector<std::int32_t> number(static_cast<std::size_t>(mesh.vertex_count()), -1), kept;
  for (std::int32_t& corner : surface.triangles.reshaped()) {
    std::int32_t& found = number[static_cast<std::size_t>(corner)];
    if (found < 0) {
      found = static_cast<std::int32_t>(kept.size());
      kept.push_back(corner);
    }
    corner = found;
  }
  surface.vertices = mesh.vertices(kept, Eigen::all);
  return surface;
}

/// The surface of a box, one corner at the origin.
inline SurfaceMesh box_surface(const std::array<int, 3>& cells, const std::array<double, 3>& lengths) {
  return boundary(box_mesh(cells, lengths));
}

/// A ball's surface about the origin: that of a cube of n^3 cells, blown up.
inline SurfaceMesh ball_surface(int n, double radius) {
  SurfaceMesh surface = box_surface({n, n, n}, {2, 2, 2});
  surface.vertices.array() -= 1;
  surface.vertices = radius * surface.vertices.rowwise().normalized();
  return surface;
}

/// Two surfaces as one.
inline SurfaceMesh together(const SurfaceMesh& a, const SurfaceMesh& b) {
  SurfaceMesh both;
  both.vertices.resize(a.vertices.rows() + b.vertices.rows(), 3);
  both.vertices << a.vertices, b.vertices;
  both.triangles.resize(a.triangles.rows() + b.triangles.rows(), 3);
  both.triangles << a.triangles, b.triangles.array() + static_cast<std::int32_t>(a.vertices.rows());
  return both;
}

}  // namespace exmat::test
