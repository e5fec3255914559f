#pragma once

#include <Eigen/Core>
#include <vector>

#include "common/core/arrays.h"
#include "common/mesh/tet_mesh.h"

namespace exmat::precompute {

/// Tets near each other.
struct TetPart {
  std::vector<Eigen::Index> tets;              ///< of the mesh, ascending
  std::vector<std::int32_t> vertices;          ///< of these, ascending
  Eigen::Matrix<std::int16_t, 4, -1> corners;  ///< of each tet among the vertices, a column each
};

/// `tets` of a mesh in parts of at most `most` <= 8191, by halving along the longest side of the box of their centres.
std::vector<TetPart> tet_parts(const TetMesh& mesh, std::vector<Eigen::Index> tets, Eigen::Index most);

}  // namespace exmat::precompute
