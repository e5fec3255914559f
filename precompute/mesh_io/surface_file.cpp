#include "precompute/mesh_io/surface_file.h"

#include <algorithm>
#include <array>
#include <fmt/format.h>
#include <string_view>

#include "common/core/input_file.h"
#include "common/core/log.h"
#include "common/mesh/surface_check.h"
#include "common/surface_io/obj_reader.h"
#include "common/surface_io/ply_reader.h"
#include "common/surface_io/stl_reader.h"
#include "precompute/mesh_io/gltf_reader.h"

namespace exmat::precompute {

namespace {

SurfaceFile read_as_it_is(const std::filesystem::path& file) {
  refuse_other_kind(file);
  const std::string extension = lower_extension(file);
  if (extension == ".glb" || extension == ".gltf") return read_gltf(file);
  if (extension == ".obj") return read_obj(file);
  if (extension == ".ply") return read_ply(file);
  if (extension == ".stl") return read_stl(file);
  refuse_extension(file, "a surface with the extension .glb, .gltf, .obj, .ply or .stl");
}

}  // namespace

Eigen::Index settle_loose_vertices(const TriangleArray& triangles, VertexArray& vertices) {
  FlagVector used = FlagVector::Zero(vertices.rows());
  for (const auto corner : triangles.reshaped()) used[corner] = 1;
  for (Eigen::Index v = 0; v < vertices.rows(); ++v)
    if (used[v] == 0) vertices.row(v) = vertices.row(triangles(0, 0));
  return (used.array() == 0).count();
}

bool is_surface_file(const std::filesystem::path& file) {
  constexpr std::array<std::string_view, 5> kExtensions{".glb", ".gltf", ".obj", ".ply", ".stl"};
  return std::ranges::find(kExtensions, lower_extension(file)) != kExtensions.end();
}

SurfaceFile read_surface_file(const std::filesystem::path& file) {
  SurfaceFile surface = read_as_it_is(file);
  const TriangleArray& triangles = surface.mesh.triangles;
  if (const auto loose = settle_loose_vertices(triangles, surface.mesh.vertices); loose > 0)
    surface.remarks.push_back(fmt::format("{} vertices of no triangle are left out of account", loose));
  for (MorphTarget& morph : surface.morphs) settle_loose_vertices(triangles, morph.positions);
  return surface;
}

void log_notes(const SurfaceFile& surface, const std::filesystem::path& file) {
  for (const std::string& remark : surface.remarks) log::info(fmt::format("{}: {}", file.string(), remark));
  for (const std::string& warning : surface.warnings) log::warning(fmt::format("{}: {}", file.string(), warning));
}

void warn_of_flat_body(const SurfaceMesh& surface, const std::filesystem::path& file) {
  if (!is_flat(surface.vertices)) return;
  log::warning(
      fmt::format("{}: the surface is flat: as a body it is a sheet as thick as the cells that fill it; give it a "
                  "thickness, and "
                  "scale no object by 0",
                  file.string()));
}

}  // namespace exmat::precompute
