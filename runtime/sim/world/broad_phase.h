#pragma once

#include <Eigen/Core>
#include <utility>
#include <vector>

#include "runtime/sim/contact/deformation_tree.h"

namespace exmat::runtime {

/// Pairs (i, j), i < j, in ascending order, of those balls that are `chosen` and overlap: sorted along the axis along
/// which they are spread the widest, then swept. `order` is scratch that keeps its memory.
void overlapping_pairs(const std::vector<DeformationTree::Ball>& balls, const std::vector<int>& chosen,
                       std::vector<int>& order, std::vector<std::pair<int, int>>& pairs);

}  // namespace exmat::runtime
