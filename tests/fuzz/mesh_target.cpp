// Any bytes in a file of the extension EXMAT_FUZZ_EXTENSION are a mesh or refused. A TetGen pair is one input, split by
// the first zero byte, and so are a .veg file and input.inc, which it may include.
#include "common/core/error.h"
#include "common/core/log.h"
#include "precompute/mesh_io/mesh_file.h"
#include "precompute/mesh_io/surface_file.h"
#include "tests/fuzz/fuzz_target.h"

namespace exmat {
namespace {

void require(bool condition) {
  if (!condition) __builtin_trap();
}

// What is read is what readers promise: numbers are finite, indices those of something.
template <typename Indices>
void require_indices(const Indices& indices, Eigen::Index count) {
  require(indices.size() > 0 && indices.minCoeff() >= 0 && indices.maxCoeff() < count);
}

void check(const precompute::SurfaceMesh& surface) {
  require(surface.vertices.allFinite());
  require_indices(surface.triangles, surface.vertices.rows());
}

void check(const precompute::MeshFile& file) {
  require(file.mesh.vertices.allFinite());
  require_indices(file.mesh.tets, file.mesh.vertex_count());
  for (const auto& [name, tets] : file.tet_sets)
    for (const std::int32_t tet : tets) require(tet >= 0 && tet < file.mesh.tet_count());
  if (file.materials) require(file.materials->density.size() == file.mesh.tet_count());
}

}  // namespace
}  // namespace exmat

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace exmat;
  const std::string_view extension = EXMAT_FUZZ_EXTENSION;
  std::string_view bytes(reinterpret_cast<const char*>(data), size);
  if (extension == ".node" || extension == ".veg")
    bytes = fuzz::split_off(bytes, extension == ".node" ? ".ele" : ".inc");
  const auto file = fuzz::input_file(EXMAT_FUZZ_EXTENSION, bytes);
  try {
    if (extension == ".obj" || extension == ".ply")
      check(precompute::read_surface(file));
    else
      check(precompute::read_mesh(file));
  } catch (const InputError&) {
  }
  return 0;
}
