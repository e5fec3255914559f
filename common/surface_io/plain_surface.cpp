#include "common/surface_io/plain_surface.h"

#include "common/core/error.h"
#include "common/surface_io/obj_reader.h"
#include "common/surface_io/ply_reader.h"
#include "common/surface_io/stl_reader.h"
#include "common/surface_io/text_input.h"

namespace exmat {

SurfaceFile read_plain_surface(const std::filesystem::path& file) {
  const std::string extension = file.extension().string();
  if (extension == ".obj") return read_obj(file);
  if (extension == ".ply") return read_ply(file);
  if (extension == ".stl") return read_stl(file);
  throw InputError({file.string(), "", "a mesh with the extension .obj, .ply or .stl",
                    extension.empty() ? "no extension" : quote(extension), "convert it, as Blender does"});
}

}  // namespace exmat
