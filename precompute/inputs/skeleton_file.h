#pragma once

#include <Eigen/Core>
#include <filesystem>

#include "common/model/reduced_model.h"

namespace exmat::precompute {

/// Bones of a JSON file (schemas/skeleton.json) for a mesh file of so many vertices. Rows of weights [n x b] add up to
/// 1, or to 0 at vertices that no joint lists; n counts vertices as the mesh file does. Throws InputError with the file
/// and the JSON pointer: a name that is repeated or unknown, parents in a circle, a vertex that the mesh does not have,
/// a list of weights of another length, weights of a vertex that are all 0, keys that do not ascend.
SkeletonData read_skeleton(const std::filesystem::path& file, Eigen::Index vertices);

}  // namespace exmat::precompute
