#include "precompute/app/mesh_command.h"

#include <fmt/format.h>

#include "common/core/atomic_file.h"
#include "common/core/command_files.h"
#include "common/core/error.h"
#include "common/core/input_file.h"
#include "common/core/log.h"
#include "common/core/timer.h"
#include "common/mesh/geometry.h"
#include "precompute/mesh_io/msh_writer.h"
#include "precompute/render/embedding.h"

namespace exmat {
namespace {

void print_cage(const MeshCommandOptions& options, const SurfaceFile& surface, const precompute::Cage& cage) {
  const double diagonal = bounding_box_diagonal(surface.mesh.vertices);
  const precompute::Embedding embedding = precompute::embed_points(cage.mesh, surface.mesh.vertices, options.surface);
  const auto length = [&](double metres) {
    return fmt::format("{:.4g} m ({:.3g} % of the surface's diagonal)", metres, 100 * metres / diagonal);
  };
  fmt::print("{:<26}{}\n", "surface",
             fmt::format("{} vertices, {} triangles", surface.mesh.vertices.rows(), surface.mesh.triangles.rows()));
  fmt::print("{:<26}{}\n", "tets", fmt::format("{} of {} vertices", cage.mesh.tet_count(), cage.mesh.vertex_count()));
  fmt::print("{:<26}{}\n", "cell size", length(cage.cell_size));
  fmt::print("{:<26}{:.1f} to {:.1f} degrees\n", "dihedral angles", cage.least_angle, cage.largest_angle);
  fmt::print("{:<26}{:.6g} m^3{}\n", "volume", cage.volume,
             cage.volume_ratio ? fmt::format(", {:.3f} times that of the surface", *cage.volume_ratio)
                               : ", of a surface that is not closed");
  fmt::print("{:<26}{}\n", "cage's farthest vertex", length(cage.farthest) + " from the surface");
  fmt::print("{:<26}{} vertices, by up to {}\n", "surface outside", embedding.outside, length(embedding.farthest));
}

}  // namespace

void mesh_command(const MeshCommandOptions& options) {
  claim_output(options.mesh, "-o");
  { const AtomicFile writable(options.mesh); }
  if (lower_extension(options.mesh) != ".msh")
    throw InputError({options.mesh, "", "a mesh to write with the extension .msh", "another", ""});
  const SurfaceFile surface = precompute::read_surface_file(options.surface);
  require_kind(options.mesh, "-o", "a mesh in the format .msh 2.2", "$MeshFormat\n2.2 0 8\n");
  precompute::log_notes(surface, options.surface);
  precompute::warn_of_flat_body(surface.mesh, options.surface);
  const precompute::Cage cage = precompute::make_cage(surface.mesh, options.settings, options.surface);
  precompute::warn_of_thin_surface(surface.mesh, cage, options.surface);
  precompute::write_msh(cage.mesh, options.mesh);
  print_cage(options, surface, cage);
}

}  // namespace exmat
