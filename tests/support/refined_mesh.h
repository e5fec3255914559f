#pragma once

#include <algorithm>
#include <array>
#include <map>
#include <utility>

#include "common/mesh/tet_mesh.h"

namespace exmat::test {

/// Each tet cut into eight of an eighth of its volume, at the middles of its edges (Bey 1995). The mesh's own vertices
/// are the first.
inline TetMesh refined(const TetMesh& mesh) {
  // Tets of the corners 0 to 3 and the middles 4 to 9 of the edges 01, 02, 03, 12, 13, 23.
  constexpr std::array<std::array<int, 2>, 6> kEdges{{{0, 1}, {0, 2}, {0, 3}, {1, 2}, {1, 3}, {2, 3}}};
  constexpr std::array<std::array<int, 4>, 8> kTets{
      {{0, 4, 5, 6}, {4, 1, 7, 8}, {5, 7, 2, 9}, {6, 8, 9, 3}, {4, 5, 6, 8}, {4, 5, 8, 7}, {5, 6, 8, 9}, {5, 7, 9, 8}}};
  std::map<std::pair<int, int>, int> middles;
  const int own = static_cast<int>(mesh.vertex_count());
  TetMesh fine;
  fine.tets.resize(8 * mesh.tet_count(), 4);
  for (Eigen::Index t = 0; t < mesh.tet_count(); ++t) {
    std::array<int, 10> points{};
    for (std::size_t k = 0; k < 4; ++k) points[k] = mesh.tets(t, static_cast<Eigen::Index>(k));
    for (std::size_t e = 0; e < kEdges.size(); ++e) {
      const auto ends = std::minmax(mesh.tets(t, kEdges[e][0]), mesh.tets(t, kEdges[e][1]));
      points[4 + e] = middles.try_emplace(ends, own + static_cast<int>(middles.size())).first->second;
    }
    for (std::size_t k = 0; k < kTets.size(); ++k)
      for (std::size_t c = 0; c < 4; ++c)
        fine.tets(8 * t + static_cast<Eigen::Index>(k), static_cast<Eigen::Index>(c)) =
            points[static_cast<std::size_t>(kTets[k][c])];
  }
  fine.vertices.resize(own + std::ssize(middles), 3);
  fine.vertices.topRows(own) = mesh.vertices;
  for (const auto& [ends, middle] : middles)
    fine.vertices.row(middle) = (mesh.vertices.row(ends.first) + mesh.vertices.row(ends.second)) / 2;
  return fine;
}

}  // namespace exmat::test
