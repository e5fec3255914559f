#pragma once

#include <string>

#include "precompute/posing/surface_pose.h"

namespace exmat::precompute {

/// Why the pose of a surface is none of an elastic body, and what to do: it is the body's mirror image, or squeezed to
/// a plane, a line or a point. Empty where nothing says so. `posed` as below.
std::string fault_of_pose(const SurfaceMesh& surface, const VertexArray& posed);

/// Why a cage misses the pose of a surface, and what to do: its vertices are in another order, the fault of the
/// pose, or the cells are too large. `posed` [v x 3] are the vertices of `surface` in the pose.
std::string reason_of_miss(const SurfaceMesh& surface, const VertexArray& posed, const SurfacePose& pose);

}  // namespace exmat::precompute
