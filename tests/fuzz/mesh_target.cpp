// Any bytes in a file of a format are a mesh or refused. The format is the last word of the name that the program is
// called by: exmat_fuzz_veg. A TetGen pair is one input, split by the first zero byte, and so are a .veg file and
// input.inc, which it may include, and a .gltf file and input.bin. Of a .pc2 file the first and the last frame are
// read, of a glTF file its look, too.
#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <nlohmann/json.hpp>

#include "common/core/error.h"
#include "common/core/log.h"
#include "common/surface_io/glb.h"
#include "precompute/mesh_io/gltf_look.h"
#include "precompute/mesh_io/mesh_file.h"
#include "precompute/mesh_io/surface_file.h"
#include "tests/fuzz/fuzz_target.h"

namespace exmat {
namespace {

void require(bool condition) {
  if (!condition) __builtin_trap();
}

// Requires what readers promise: numbers are finite, indices those of something.
template <typename Indices>
void require_indices(const Indices& indices, Eigen::Index count) {
  require(indices.size() > 0 && indices.minCoeff() >= 0 && indices.maxCoeff() < count);
}

void check(const SurfaceMesh& surface) {
  require(surface.vertices.allFinite());
  require_indices(surface.triangles, surface.vertices.rows());
}

void check(const SurfaceFile& surface) {
  check(surface.mesh);
  const Eigen::Index count = surface.mesh.vertices.rows();
  for (const auto& morph : surface.morphs) require(morph.positions.rows() == count && morph.positions.allFinite());
  for (const auto& [name, flags] : surface.parts) require(flags.size() == count && flags.maxCoeff() == 1);
  require(surface.colours.rows() == 0 || surface.colours.rows() == count);
  require((surface.colours.array() >= 0).all() && (surface.colours.array() <= 1).all());
  require(!surface.files.empty());
}

void check(const precompute::SurfaceLook& look) {
  require(look.vertices.size() > 0 && look.frames.rows() == 3 * look.vertices.size() && look.frames.allFinite());
  require(nlohmann::json::parse(parts_of_glb("look", look.glb).json).at("meshes").size() > 0);
}

bool is_surface(std::string_view extension) {
  constexpr std::array<std::string_view, 5> kSurfaces{".obj", ".ply", ".stl", ".glb", ".gltf"};
  return std::ranges::find(kSurfaces, extension) != kSurfaces.end();
}

// Ends the program where the name that it was called by has no format that it knows.
std::string extension_of(std::string_view program) {
  constexpr std::array<std::string_view, 6> kOthers{".veg", ".msh", ".mesh", ".vtk", ".node", ".pc2"};
  const std::string extension = "." + std::string(program.substr(program.rfind('_') + 1));
  require(is_surface(extension) || std::ranges::find(kOthers, extension) != kOthers.end());
  return extension;
}

// With the number of vertices that its header has, and with another.
void read_frames(const std::filesystem::path& file, std::string_view bytes) {
  std::int32_t vertices = 0, frames = 0;
  if (bytes.size() >= 32) {
    std::memcpy(&vertices, bytes.data() + 16, sizeof vertices);
    std::memcpy(&frames, bytes.data() + 28, sizeof frames);
  }
  for (const std::int64_t frame : {std::int64_t{0}, std::int64_t{frames} - 1}) {
    const VertexArray positions = precompute::read_point_cache_frame(file, frame, vertices);
    require(positions.rows() == vertices && positions.allFinite());
  }
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
  static const std::string extension = extension_of(program_invocation_short_name);
  std::string_view bytes(reinterpret_cast<const char*>(data), size);
  if (extension == ".node" || extension == ".veg" || extension == ".gltf")
    bytes = fuzz::split_off(bytes, extension == ".node" ? ".ele" : extension == ".veg" ? ".inc" : ".bin");
  const auto file = fuzz::input_file(extension.c_str(), bytes);
  try {
    if (is_surface(extension)) {
      check(precompute::read_surface_file(file));
      if (extension.starts_with(".gl"))
        if (const auto look = precompute::read_gltf_look(file, 1)) check(*look);
    } else if (extension == ".pc2")
      read_frames(file, bytes);
    else
      check(precompute::read_mesh(file));
  } catch (const InputError&) {
  }
  return 0;
}
