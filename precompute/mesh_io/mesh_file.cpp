#include "precompute/mesh_io/mesh_file.h"

#include "common/core/input_file.h"
#include "precompute/mesh_io/medit_reader.h"
#include "precompute/mesh_io/msh_reader.h"
#include "precompute/mesh_io/surface_file.h"
#include "precompute/mesh_io/tetgen_reader.h"
#include "precompute/mesh_io/veg_reader.h"
#include "precompute/mesh_io/vtk_reader.h"

namespace exmat::precompute {

MeshFile read_mesh(const std::filesystem::path& file) {
  refuse_other_kind(file);
  const std::string extension = lower_extension(file);
  if (extension == ".veg") return read_veg(file);
  if (extension == ".msh") return read_msh(file);
  if (extension == ".node" || extension == ".ele") return read_tetgen(file);
  if (extension == ".mesh") return read_medit(file);
  if (extension == ".vtk") return read_vtk(file);
  refuse_extension(file, "a mesh file with the extension .veg, .msh, .node, .ele, .mesh or .vtk",
                   is_surface_file(file) ? "it is a surface: name it by \"surface\" in place of \"mesh\"" : "");
}

}  // namespace exmat::precompute
