#pragma once

#include <vector>

#include "common/mesh/tet_mesh.h"

namespace exmat::precompute {

/// Number of tets that a motion turns inside out, or flattens, in its frames.
struct InvertedTets {
  Eigen::Index most = 0;  ///< in one frame
  Eigen::Index last = 0;  ///< in the last frame

  bool any() const { return most > 0; }
};

/// Tets of det F <= 0 at the positions [n x 3] of the mesh's vertices. One that is not a number counts.
Eigen::Index inverted_tet_count(const TetMesh& rest, const VertexArray& positions);

/// Counts them in some frames; none: no inverted tets.
InvertedTets inverted_tets(const TetMesh& rest, const std::vector<VertexArray>& frames);

}  // namespace exmat::precompute
