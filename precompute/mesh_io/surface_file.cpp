#include "precompute/mesh_io/surface_file.h"

#include "common/core/error.h"
#include "common/surface_io/obj_reader.h"
#include "common/surface_io/ply_reader.h"
#include "common/surface_io/stl_reader.h"
#include "common/surface_io/text_input.h"
#include "precompute/mesh_io/gltf_reader.h"

namespace exmat::precompute {

SurfaceFile read_surface_file(const std::filesystem::path& file) {
  const std::string extension = file.extension().string();
  if (extension == ".glb" || extension == ".gltf") return read_gltf(file);
  if (extension == ".obj") return read_obj(file);
  if (extension == ".ply") return read_ply(file);
  if (extension == ".stl") return read_stl(file);
  throw InputError({file.string(), "", "a surface with the extension .glb, .gltf, .obj, .ply or .stl",
                    extension.empty() ? "no extension" : quote(extension), ""});
}

SurfaceMesh read_surface(const std::filesystem::path& file) { return std::move(read_surface_file(file).mesh); }

}  // namespace exmat::precompute
