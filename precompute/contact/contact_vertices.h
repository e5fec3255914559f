#pragma once

#include <optional>

#include "common/model/reduced_model.h"

namespace exmat::precompute {

/// n shares of the surface: a third of the area of each triangle at a vertex, 0 inside [m^2].
Eigen::VectorXd vertex_areas(const ObjectData& object);

/// Group /contact: the surface vertices that are not fixed and `may_touch` [n], of these `count`, which then share the
/// area of all of these: each area goes to the nearest. No vertices where none is left.
ContactData contact_data(const ObjectData& object, const RowMatrix& basis, const FlagVector& may_touch,
                         std::optional<int> count);

}  // namespace exmat::precompute
