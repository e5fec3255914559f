#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "common/config/asset_config.h"
#include "common/core/arrays.h"
#include "common/mesh/tet_mesh.h"

namespace exmat::precompute {

/// Sorted unique 0-based ids of the selected vertices. Throws InputError where an id is no vertex, a file cannot be
/// read, or nothing is selected (the message then gives the mesh's bounding box). `asset_file` is for the message.
std::vector<std::int32_t> select_vertices(const VertexArray& vertices, const VertexSelection& selection,
                                          const std::string& asset_file);

/// Tets of a mesh file by the names that it gives them.
using TetSets = std::map<std::string, std::vector<std::int32_t>>;

/// The same of tets: those whose centroid the box or the sphere holds, by id, or one of the `sets` (a name that is none
/// is an InputError that lists them). `mesh` and `sets` are those of the file.
std::vector<std::int32_t> select_tets(const TetMesh& mesh, const TetSets& sets, const TetSelection& selection,
                                      const std::string& asset_file);

}  // namespace exmat::precompute
