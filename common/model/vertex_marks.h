#pragma once

#include <map>
#include <string>

#include "common/core/arrays.h"
#include "common/model/reduced_model.h"

namespace exmat {

/// Parts and colours of a surface at n points: those of the place of the surface that each point is nearest to.
struct VertexMarks {
  std::map<std::string, FlagVector> parts;  ///< n flags each; names without zero bytes
  VertexArray colours;                      ///< n x 3 in 0 to 1; no rows where the surface has none
};

/// Puts the marks of its vertices into an object, a set of parts for each combination that there is.
void pack_marks(const VertexMarks& marks, ObjectData& object);

/// Their inverse; no parts and no colours where the object was not made about a surface.
VertexMarks marks_of(const ObjectData& object);

}  // namespace exmat
