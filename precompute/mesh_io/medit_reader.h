#pragma once

#include "precompute/mesh_io/mesh_file.h"

namespace exmat::precompute {

/// Reads MEDIT's .mesh, versions 1 to 4, text (Frey 2001, INRIA RT-0253; github.com/LoicMarechal/libMeshb). Reference
/// numbers of the tets become tet_sets by number, 0 is none; those of vertices, and elements of other types are left
/// out, volumes among them with a warning; unknown keywords are passed over. Binary files, tets of higher order and
/// files without "End" are refused. Throws InputError with file, line, expected and found.
MeshFile read_medit(const std::filesystem::path& file);

}  // namespace exmat::precompute
