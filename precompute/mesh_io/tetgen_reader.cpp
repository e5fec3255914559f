#include "precompute/mesh_io/tetgen_reader.h"

#include <cmath>

#include "common/surface_io/mesh_arrays.h"
#include "precompute/mesh_io/mesh_tables.h"

namespace exmat::precompute {
namespace {

void expect_end(const CommentedLines& lines) {
  if (lines.current()) lines.fail("the end of the file", "check the count that its first line declares");
}

// The region of each tet; none where the column is not one of whole numbers.
std::vector<std::int64_t> regions_of(const std::vector<std::string_view>& column) {
  constexpr double kMostRegions = 1e9;
  std::vector<std::int64_t> regions;
  for (const std::string_view field : column) {
    const auto value = parse_real(field);
    if (!value || *value != std::floor(*value) || std::abs(*value) > kMostRegions) return {};
    regions.push_back(static_cast<std::int64_t>(*value));
  }
  return regions;
}

}  // namespace

MeshFile read_tetgen(const std::filesystem::path& file) {
  const bool capitals = file.extension() == ".NODE" || file.extension() == ".ELE";
  std::filesystem::path node_file = file, element_file = file;
  node_file.replace_extension(capitals ? ".NODE" : ".node");
  element_file.replace_extension(capitals ? ".ELE" : ".ele");
  MeshTables tables;
  CommentedLines nodes(node_file, "TetGen's .node file, beside its .ele file");
  tables.read_vertices(nodes);
  expect_end(nodes);
  CommentedLines elements(element_file, "TetGen's .ele file, beside its .node file");
  tables.read_tets(elements);
  expect_end(elements);
  MeshFile result;
  result.mesh = tables.mesh();
  result.tet_sets = region_sets(regions_of(tables.last_columns()));
  result.files = {file, file == node_file ? element_file : node_file};
  return result;
}

}  // namespace exmat::precompute
