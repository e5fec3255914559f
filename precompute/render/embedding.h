#pragma once

#include <string>

#include "common/mesh/nearest_point.h"
#include "common/mesh/tet_mesh.h"

namespace exmat::precompute {

/// Points that move with a tet mesh: each with the affine motion of one tet.
struct Embedding {
  BarycentricPoints points;  ///< rows sum to 1, and give the points back; negative outside the tet
  Eigen::Index outside = 0;  ///< points farther from the body than kOnSurface of its size
  double farthest = 0;       ///< [m] distance of the farthest point from the body
};

/// Share of the bounding box's diagonal within which a point counts as being on the body.
constexpr double kOnSurface = 1e-6;

/// Embeds [k x 3] points: those inside in their tet, others in the tet nearest to them, by the same affine
/// coordinates. Logs how many are outside; `name` is for that message. The mesh's volumes must be positive.
Embedding embed_points(const TetMesh& mesh, const VertexArray& points, const std::string& name);

}  // namespace exmat::precompute
