#include "precompute/mesh_io/msh_writer.h"

#include <fmt/format.h>
#include <iterator>
#include <string>

#include "common/core/atomic_file.h"

namespace exmat::precompute {

void write_msh(const TetMesh& mesh, const std::filesystem::path& file) {
  std::string text = fmt::format("$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n{}\n", mesh.vertex_count());
  const auto out = std::back_inserter(text);
  for (Eigen::Index v = 0; v < mesh.vertex_count(); ++v)
    fmt::format_to(out, "{} {:.17g} {:.17g} {:.17g}\n", v + 1, mesh.vertices(v, 0), mesh.vertices(v, 1),
                   mesh.vertices(v, 2));
  fmt::format_to(out, "$EndNodes\n$Elements\n{}\n", mesh.tet_count());
  // Type 4, two tags: no physical group, the volume 1.
  for (Eigen::Index t = 0; t < mesh.tet_count(); ++t)
    fmt::format_to(out, "{} 4 2 0 1 {} {} {} {}\n", t + 1, mesh.tets(t, 0) + 1, mesh.tets(t, 1) + 1,
                   mesh.tets(t, 2) + 1, mesh.tets(t, 3) + 1);
  text += "$EndElements\n";
  write_file_atomically(file, text);
}

}  // namespace exmat::precompute
