#include "common/surface_io/surface.h"

namespace exmat {

void add_fan(const std::vector<std::int32_t>& polygon, std::vector<std::array<std::int32_t, 3>>& triangles) {
  for (std::size_t corner = 2; corner < polygon.size(); ++corner)
    triangles.push_back({polygon[0], polygon[corner - 1], polygon[corner]});
}

}  // namespace exmat
