#pragma once

#include <Eigen/Core>
#include <vector>

#include "common/core/arrays.h"
#include "common/mesh/elements.h"

namespace exmat::precompute {

/// Elements near each other.
struct ElementPart {
  std::vector<Eigen::Index> elements;  ///< elements of the mesh, ascending
  std::vector<std::int32_t> vertices;  ///< vertices of these, ascending
  IndexLists places;                   ///< places of each element's vertices among these
};

/// `chosen` elements of a mesh in parts of at most `most`, by halving along the longest side of the box of their
/// centres.
std::vector<ElementPart> element_parts(const VertexArray& vertices, const Elements& elements,
                                       std::vector<Eigen::Index> chosen, Eigen::Index most);

}  // namespace exmat::precompute
