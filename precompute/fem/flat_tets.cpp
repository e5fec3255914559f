#include "precompute/fem/flat_tets.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <limits>

#include "common/mesh/geometry.h"

namespace exmat::precompute {
namespace {

// Six volumes over twice the largest face, over the longest edge.
double relative_height(const TetMesh& mesh, Eigen::Index tet) {
  const Eigen::Matrix<double, 4, 3> corners = tet_positions(mesh, tet);
  double face = 0, edge = 0;
  for (int a = 0; a < 4; ++a) {
    const Eigen::RowVector3d first = corners.row((a + 1) % 4) - corners.row(a);
    const Eigen::RowVector3d second = corners.row((a + 2) % 4) - corners.row(a);
    face = std::max(face, first.cross(second).norm());
    for (int b = 0; b < a; ++b) edge = std::max(edge, (corners.row(a) - corners.row(b)).norm());
  }
  const Eigen::RowVector3d x = corners.row(1) - corners.row(0), y = corners.row(2) - corners.row(0),
                           z = corners.row(3) - corners.row(0);
  return std::abs(x.cross(y).dot(z)) / (face * edge);
}

}  // namespace

FlatTet flattest_tet(const TetMesh& mesh) {
  FlatTet flattest{0, std::numeric_limits<double>::infinity()};
  for (Eigen::Index tet = 0; tet < mesh.tet_count(); ++tet)
    if (const double height = relative_height(mesh, tet); height < flattest.height) flattest = {tet, height};
  return flattest;
}

std::string to_string(const TetMesh& mesh, const FlatTet& flat) {
  const Eigen::RowVector3d centre = tet_positions(mesh, flat.tet).colwise().mean();
  return fmt::format("tet {} (1-based) at ({:.6g}, {:.6g}, {:.6g}), whose least height is {:.1e} of its longest edge",
                     flat.tet + 1, centre[0], centre[1], centre[2], flat.height);
}

}  // namespace exmat::precompute
