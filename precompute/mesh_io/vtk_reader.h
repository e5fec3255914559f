#pragma once

#include "precompute/mesh_io/mesh_file.h"

namespace exmat::precompute {

/// Reads legacy .vtk files of unstructured grids, text or binary, with CELLS as before version 5 or as OFFSETS and
/// CONNECTIVITY (docs.vtk.org, "Legacy file formats"). Tets are the cells of type 10; other volume cells are left out
/// with a warning, tets of higher order are refused. Cell data of one integer each, of at most 1,000 different values,
/// become tet_sets "NAME VALUE"; other data are left out. Throws InputError with file, line or byte, expected and
/// found.
MeshFile read_vtk(const std::filesystem::path& file);

}  // namespace exmat::precompute
