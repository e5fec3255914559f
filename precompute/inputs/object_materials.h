#pragma once

#include <optional>
#include <vector>

#include "common/config/asset_config.h"
#include "common/mesh/tet_mesh.h"
#include "precompute/inputs/inputs.h"
#include "precompute/mesh_io/vertex_selection.h"

namespace exmat::precompute {

/// The material of each kept tet: that of the asset's `material`, its absent numbers from the mesh file, then those of
/// each of its `materials` in order. `file_mesh` and `sets` are as in the file, `kept_tets` [n_t] what check_mesh kept
/// of it. Adds the files that were read. Throws InputError where a number is nowhere, a part selects nothing, or the
/// Poisson ratio of a tet is none for the model.
TetMaterials object_materials(const AssetConfig& asset, const TetMesh& file_mesh, const TetSets& sets,
                              const std::optional<TetMaterials>& file_materials,
                              const std::vector<std::int32_t>& kept_tets, InputFiles& files);

}  // namespace exmat::precompute
