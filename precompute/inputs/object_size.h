#pragma once

#include <string>
#include <vector>

#include "precompute/inputs/inputs.h"

namespace exmat::precompute {

/// Why an object is hardly as large as its file says, in metres, for its material; empty where it may be. Elastic
/// bodies bear their own weight: density x gravity x longest edge / Young's modulus, the strain at the foot of a column
/// as high as the body is long, is below 1 (Galilei 1638). Stiff ones, which bear any, are at most kLargest long, and
/// all at least kSmallest. Also says where an object is so far from the origin that its coordinates lose digits.
std::string remark_on_size(const TetMesh& mesh, const TetMaterials& materials);

/// Throws InputError where masses or stiffnesses of the body are beyond what numbers of 16 digits and their products
/// hold: density x length^3 and Young's modulus x length from 1e-60 to 1e60; or where the body is so soft that its
/// modes are not found. `file` of the asset.
void require_numbers(const TetMesh& mesh, const TetMaterials& materials, const std::string& file);

/// Warns (in the log and in `warnings`) of that. `name` of the object's file.
void warn_of_size(const ObjectInput& object, const std::string& name, std::vector<std::string>& warnings);

/// Lengths of a body [m] above and below which its file gives it in another unit, as a rule.
constexpr double kLargest = 50, kSmallest = 0.005;

}  // namespace exmat::precompute
