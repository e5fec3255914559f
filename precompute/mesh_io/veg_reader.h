#pragma once

#include "precompute/mesh_io/mesh_file.h"

namespace exmat::precompute {

/// Reads VegaFEM's ASCII .veg: *VERTICES, *ELEMENTS TET (or *TETS), *MATERIAL ENU, *SET, *REGION, *INCLUDE. Ids of
/// vertices and tets count up by one from 0 or 1. *SETs are sets of tets; of several regions the last one that holds a
/// tet gives its material. Throws InputError with file, line, expected and found.
MeshFile read_veg(const std::filesystem::path& file);

}  // namespace exmat::precompute
