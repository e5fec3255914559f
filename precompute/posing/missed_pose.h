#pragma once

#include <string>

#include "precompute/posing/surface_pose.h"

namespace exmat::precompute {

/// Why a cage misses the pose of a surface, and what to do: the pose is the mirror image, its vertices are in another
/// order, or the cells are too large. `posed` [v x 3] are the vertices of `surface` in the pose.
std::string reason_of_miss(const SurfaceMesh& surface, const VertexArray& posed, const SurfacePose& pose);

}  // namespace exmat::precompute
