#pragma once

#include <optional>
#include <string>

#include "common/model/reduced_model.h"

namespace exmat::precompute {

/// n shares of the surface: a third of the area of each triangle at a vertex, 0 inside [m^2].
Eigen::VectorXd vertex_areas(const ObjectData& object);

/// Most contact vertices where an asset does not say how many: a landing changes as little as by half the time step
/// (tests/benchmark/contact_sample.py), and does not cost what the surface has.
inline constexpr int kContactVertices = 1000;

/// Group /contact: the surface vertices that are not fixed and `may_touch` [n], of these `count`, or kContactVertices,
/// which then share the area of all of these: each area goes to the nearest. No vertices where none is left.
ContactData contact_data(const ObjectData& object, const RowMatrix& basis, const FlagVector& may_touch,
                         std::optional<int> count);

/// Numbers of contact vertices and of all that might be, and the way to have all, for the log.
std::string contact_summary(const ObjectData& object, const FlagVector& may_touch, const ContactData& contact);

}  // namespace exmat::precompute
