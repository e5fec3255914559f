#pragma once

#include <string>

#include "common/mesh/tet_mesh.h"

namespace exmat::precompute {

struct FlatTet {
  Eigen::Index tet = 0;
  double height = 0;  ///< least height over the longest edge; 0.82 of a regular tet
};

/// The flattest tet of a mesh that has some.
FlatTet flattest_tet(const TetMesh& mesh);

/// Tets of lower heights may be why a solver fails.
constexpr double kFlat = 1e-4;

/// "tet 17 (1-based) at (0.5, 0, 1), whose least height is 1.0e-09 of its longest edge".
std::string to_string(const TetMesh& mesh, const FlatTet& flat);

}  // namespace exmat::precompute
