#pragma once

#include <array>

#include "common/mesh/tet_mesh.h"

namespace exmat::test {

/// A box of the given edge lengths, one corner at the origin, cut into cells of six tets along their diagonals. Vertex
/// (x, y, z) of the grid has the index (z * (ny + 1) + y) * (nx + 1) + x.
inline TetMesh box_mesh(const std::array<int, 3>& cells, const std::array<double, 3>& lengths) {
  constexpr std::array<std::array<int, 4>, 6> kTets{
      {{0, 1, 3, 7}, {0, 3, 2, 7}, {0, 2, 6, 7}, {0, 6, 4, 7}, {0, 4, 5, 7}, {0, 5, 1, 7}}};
  const auto [nx, ny, nz] = cells;
  const auto vertex = [nx = nx, ny = ny](int x, int y, int z) { return (z * (ny + 1) + y) * (nx + 1) + x; };
  TetMesh mesh;
  mesh.vertices.resize((nx + 1) * (ny + 1) * (nz + 1), 3);
  for (int z = 0; z <= nz; ++z)
    for (int y = 0; y <= ny; ++y)
      for (int x = 0; x <= nx; ++x)
        mesh.vertices.row(vertex(x, y, z)) << lengths[0] * x / nx, lengths[1] * y / ny, lengths[2] * z / nz;
  mesh.tets.resize(6 * nx * ny * nz, 4);
  Eigen::Index tet = 0;
  for (int z = 0; z < nz; ++z)
    for (int y = 0; y < ny; ++y)
      for (int x = 0; x < nx; ++x)
        for (const auto& corners : kTets) {
          for (int k = 0; k < 4; ++k) {
            const int bits = corners[static_cast<std::size_t>(k)];
            mesh.tets(tet, k) = vertex(x + (bits & 1), y + (bits >> 1 & 1), z + (bits >> 2 & 1));
          }
          ++tet;
        }
  return mesh;
}

/// A cube of `cells`^3 cells of edge `edge`.
inline TetMesh cube_grid(int cells, double edge = 1.0) {
  return box_mesh({cells, cells, cells}, {cells * edge, cells * edge, cells * edge});
}

}  // namespace exmat::test
