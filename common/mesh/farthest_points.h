#pragma once

#include <Eigen/Core>
#include <vector>

#include "common/mesh/tet_mesh.h"

namespace exmat {

/// `count` of these points spread evenly: each next one is the farthest from those before, the first from the centroid
/// (Gonzalez 1985). Indices in the order of choice; all of them, ascending, where there are no more.
std::vector<Eigen::Index> farthest_points(const VertexArray& points, Eigen::Index count);

}  // namespace exmat
