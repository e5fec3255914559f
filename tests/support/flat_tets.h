#pragma once

#include "common/mesh/geometry.h"
#include "common/mesh/tet_mesh.h"

namespace exmat::test {

/// Splits `count` tets, spread over the mesh, at a point that is `height` of the way from the middle of a face to the
/// vertex opposite: three good tets and a flat one each.
inline TetMesh with_flat_tets(TetMesh mesh, Eigen::Index count, double height) {
  const Eigen::Index tets = mesh.tet_count(), vertices = mesh.vertex_count();
  mesh.tets.conservativeResize(tets + 3 * count, 4);
  mesh.vertices.conservativeResize(vertices + count, 3);
  for (Eigen::Index k = 0; k < count; ++k) {
    const Eigen::Index tet = k * tets / count;
    const Eigen::Matrix<double, 4, 3> corners = tet_positions(mesh, tet);
    const Eigen::RowVector3d middle = corners.topRows<3>().colwise().mean();
    mesh.vertices.row(vertices + k) = middle + height * (corners.row(3) - middle);
    const Eigen::Matrix<std::int32_t, 1, 4> whole = mesh.tets.row(tet);
    for (int corner = 0; corner < 4; ++corner) {
      const Eigen::Index part = corner == 3 ? tet : tets + 3 * k + corner;  // the flat one keeps the place
      mesh.tets.row(part) = whole;
      mesh.tets(part, corner) = static_cast<std::int32_t>(vertices + k);
    }
  }
  return mesh;
}

}  // namespace exmat::test
