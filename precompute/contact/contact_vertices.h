#pragma once

#include <optional>
#include <vector>

#include "common/model/reduced_model.h"

namespace exmat::precompute {

/// n shares of the surface: a third of the area of each triangle at a vertex, 0 inside [m^2].
Eigen::VectorXd vertex_areas(const ObjectData& object);

/// `count` of these points spread evenly: each next one is the farthest from those before, the first from the centroid
/// (Gonzalez 1985). Indices in the order of choice; all of them, ascending, where there are no more.
std::vector<Eigen::Index> farthest_points(const VertexArray& points, Eigen::Index count);

/// Group /contact: the surface vertices that are not fixed and `may_touch` [n], of these `count`, which then share the
/// area of all of these: each area goes to the nearest. No vertices where none is left.
ContactData contact_data(const ObjectData& object, const RowMatrix& basis, const FlagVector& may_touch,
                         std::optional<int> count);

}  // namespace exmat::precompute
