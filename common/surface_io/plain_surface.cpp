#include "common/surface_io/plain_surface.h"

#include "common/core/input_file.h"
#include "common/surface_io/obj_reader.h"
#include "common/surface_io/ply_reader.h"
#include "common/surface_io/stl_reader.h"

namespace exmat {

SurfaceFile read_plain_surface(const std::filesystem::path& file) {
  refuse_other_kind(file);
  const std::string extension = lower_extension(file);
  if (extension == ".obj") return read_obj(file);
  if (extension == ".ply") return read_ply(file);
  if (extension == ".stl") return read_stl(file);
  refuse_extension(file, "a mesh with the extension .obj, .ply or .stl");
}

}  // namespace exmat
