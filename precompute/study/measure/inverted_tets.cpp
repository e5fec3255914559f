#include "precompute/study/measure/inverted_tets.h"

#include <Eigen/LU>
#include <algorithm>

namespace exmat::precompute {
namespace {

// Six times the signed volume.
double determinant(const TetArray& tets, const VertexArray& positions, Eigen::Index tet) {
  Eigen::Matrix3d edges;
  for (int i = 0; i < 3; ++i) edges.row(i) = positions.row(tets(tet, i + 1)) - positions.row(tets(tet, 0));
  return edges.determinant();
}

}  // namespace

Eigen::Index inverted_tet_count(const TetMesh& rest, const VertexArray& positions) {
  Eigen::Index count = 0;
  for (Eigen::Index t = 0; t < rest.tet_count(); ++t)
    count += !(determinant(rest.tets, positions, t) / determinant(rest.tets, rest.vertices, t) > 0);
  return count;
}

InvertedTets inverted_tets(const TetMesh& rest, const std::vector<VertexArray>& frames) {
  InvertedTets found;
  for (const VertexArray& positions : frames) {
    found.last = inverted_tet_count(rest, positions);
    found.most = std::max(found.most, found.last);
  }
  return found;
}

}  // namespace exmat::precompute
