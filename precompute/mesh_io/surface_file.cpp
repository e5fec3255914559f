#include "precompute/mesh_io/surface_file.h"

#include "common/core/error.h"
#include "precompute/mesh_io/gltf_reader.h"
#include "precompute/mesh_io/obj_reader.h"
#include "precompute/mesh_io/ply_reader.h"
#include "precompute/mesh_io/stl_reader.h"
#include "precompute/mesh_io/text_input.h"

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

void add_fan(const std::vector<std::int32_t>& polygon, std::vector<std::array<std::int32_t, 3>>& triangles) {
  for (std::size_t corner = 2; corner < polygon.size(); ++corner)
    triangles.push_back({polygon[0], polygon[corner - 1], polygon[corner]});
}

}  // namespace exmat::precompute
