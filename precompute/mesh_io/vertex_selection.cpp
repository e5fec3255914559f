#include "precompute/mesh_io/vertex_selection.h"

#include <algorithm>
#include <fmt/format.h>
#include <type_traits>

#include "common/core/error.h"
#include "common/mesh/geometry.h"

namespace exmat::precompute {
namespace {

std::string names_of(const TetSets& sets) {
  std::string names;
  for (const auto& [name, tets] : sets) names += fmt::format("{}\"{}\"", names.empty() ? "" : ", ", name);
  return names.empty() ? "none" : names;
}

std::vector<std::int32_t> tets_of_set(const TetSets& sets, const std::string& name, const std::string& asset_file) {
  const auto found = sets.find(name);
  if (found == sets.end())
    throw InputError(
        {asset_file, "set", "a set of the mesh file", fmt::format("\"{}\"", name), "the file has " + names_of(sets)});
  if (found->second.empty()) throw InputError({asset_file, "set", "at least one tet of the mesh", "none", ""});
  std::vector<std::int32_t> tets = found->second;
  std::ranges::sort(tets);
  tets.erase(std::unique(tets.begin(), tets.end()), tets.end());
  return tets;
}

}  // namespace

std::vector<std::int32_t> select_vertices(const VertexArray& vertices, const VertexSelection& selection,
                                          const std::string& asset_file) {
  return select_points({.points = vertices, .file = asset_file}, selection);
}

std::vector<std::int32_t> select_tets(const TetMesh& mesh, const TetSets& sets, const TetSelection& selection,
                                      const std::string& asset_file) {
  VertexArray centroids(mesh.tet_count(), 3);
  for (Eigen::Index t = 0; t < mesh.tet_count(); ++t) centroids.row(t) = tet_positions(mesh, t).colwise().mean();
  const auto select = [&](const auto& chosen) {
    if constexpr (std::is_same_v<std::decay_t<decltype(chosen)>, SetSelection>)
      return tets_of_set(sets, chosen.name, asset_file);
    else
      return select_points({.points = centroids, .noun = "tet", .file = asset_file}, chosen);
  };
  return std::visit(select, selection);
}

}  // namespace exmat::precompute
