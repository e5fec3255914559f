#pragma once

#include <vector>

#include "common/mesh/tet_mesh.h"

namespace exmat::precompute {

/// Landmarks that contradict the others: positions in the lists of vertices of two meshes of one body. A pose keeps
/// the lengths of ways within the body, so a landmark whose ways to most others differ from mesh to mesh is elsewhere.
/// Worst first; at most a quarter, and none of fewer than six.
std::vector<std::size_t> contradicting_landmarks(const TetMesh& rest, const std::vector<std::int32_t>& on_rest,
                                                 const TetMesh& pose, const std::vector<std::int32_t>& on_pose);

/// [l x l] lengths of the shortest ways along the edges of a mesh between l of its vertices.
Eigen::MatrixXd edge_distances(const TetMesh& mesh, const std::vector<std::int32_t>& vertices);

}  // namespace exmat::precompute
