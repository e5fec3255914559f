#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "common/mesh/tet_mesh.h"

namespace exmat {

/// Rows as they are read, in the order of the file.
VertexArray vertex_array(const std::vector<std::array<double, 3>>& rows);
TetArray tet_array(const std::vector<std::array<std::int32_t, 4>>& rows);
TriangleArray triangle_array(const std::vector<std::array<std::int32_t, 3>>& rows);

/// Sets of tets by the number of their region, one for each tet; 0 marks tets of none.
std::map<std::string, std::vector<std::int32_t>> region_sets(const std::vector<std::int64_t>& regions);

}  // namespace exmat
