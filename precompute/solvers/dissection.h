#pragma once

#include <vector>

#include "precompute/solvers/elimination.h"

namespace exmat::precompute {

/// The place of each vertex where the graph is eliminated by nested dissection (Scotch): little fill in large meshes.
/// The same for every number of threads.
std::vector<std::int32_t> nested_dissection(const Graph& graph);

}  // namespace exmat::precompute
