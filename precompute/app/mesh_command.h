#pragma once

#include <string>

#include "precompute/meshing/cage.h"

namespace exmat {

struct MeshCommandOptions {
  std::string surface, mesh;  ///< files
  precompute::CageSettings settings;
};

/// Encloses a surface with tets, writes these (.msh) and prints what they are like.
void mesh_command(const MeshCommandOptions& options);

}  // namespace exmat
