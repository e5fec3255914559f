#pragma once

#include "precompute/mesh_io/mesh_file.h"

namespace exmat::precompute {

/// Reads TetGen's pair of NAME.node and NAME.ele, of which either is named (wias-berlin.de/software/tetgen/
/// fformats.html). Ids count up from 0 or 1; attributes of points and boundary markers are left out. The last attribute
/// of the tets, where it is a whole number everywhere, is their region: tet_sets by its number, 0 is none. Tets of
/// second order (10 nodes) are refused. Throws InputError with file, line, expected and found.
MeshFile read_tetgen(const std::filesystem::path& file);

}  // namespace exmat::precompute
