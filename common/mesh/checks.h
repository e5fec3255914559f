#pragma once

#include <string>
#include <vector>

#include "common/mesh/tet_mesh.h"

namespace exmat {

/// Which faults to mend by dropping instead of refusing.
struct MeshCheckOptions {
  bool drop_degenerate_tets = false;
  bool drop_unreferenced_vertices = false;
  bool drop_smaller_components = false;  ///< keeps the component of the largest volume
};

/// Changes that check_mesh made.
struct MeshReport {
  Eigen::Index reoriented_tets = 0;
  Eigen::Index dropped_degenerate_tets = 0;
  Eigen::Index dropped_vertices = 0;
  Eigen::Index dropped_components = 0;
  std::vector<std::int32_t> kept_vertices;  ///< new index -> index in the file
  std::vector<std::int32_t> kept_tets;      ///< new index -> index in the file
};

/// Throws InputError unless the bounding box's longest edge is from 1e-100 to 1e100 m: volumes beyond overflow.
void require_extent(const VertexArray& vertices, const std::string& file);

/// Makes a mesh sound: inverted tets are re-oriented; NaN, no extent, out-of-range indices, repeated corners,
/// degenerate tets (volume at most 1e-12 times the cube of the longest edge), duplicate tets, unreferenced vertices and
/// several components (joined by faces) are an InputError that names the first one and the number of them, or dropped
/// as `options` say. `file` is for the message.
MeshReport check_mesh(TetMesh& mesh, const std::string& file, const MeshCheckOptions& options);

}  // namespace exmat
