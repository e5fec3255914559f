#pragma once

#include <array>
#include <cstdint>
#include <string_view>
#include <vector>

#include "common/mesh/tet_mesh.h"
#include "common/surface_io/commented_lines.h"
#include "common/surface_io/text_input.h"

namespace exmat::precompute {

/// Passes over the `further` last columns of a row, which must be there and nothing after them.
void finish_row(const FileLine& line, Fields& fields, int further);

/// Tables of vertices and tets as TetGen writes them, which Vega took over: a line of counts, then rows whose ids count
/// up by one from 0 or 1 (wias-berlin.de/software/tetgen/fformats.html). Faults are InputErrors of a line.
class MeshTables {
 public:
  /// 'rows 3 further...', then 'id x y z further...'. Leaves the lines after the table.
  void read_vertices(CommentedLines& lines);

  /// 'rows 4 further...', then 'id a b c d further...', the corners ids of vertices read before.
  void read_tets(CommentedLines& lines);

  Eigen::Index vertex_count() const { return std::ssize(vertices_); }
  Eigen::Index tet_count() const { return std::ssize(tets_); }

  /// The tet of that id, 0-based.
  std::int32_t tet_index(const FileLine& line, std::string_view id) const;

  /// The last of the further columns of each tet; none where there are none.
  const std::vector<std::string_view>& last_columns() const { return last_columns_; }

  TetMesh mesh() const;

 private:
  std::vector<std::array<double, 3>> vertices_;
  std::vector<std::array<std::int32_t, 4>> tets_;
  std::vector<std::string_view> last_columns_;
  std::int64_t vertex_base_ = 1, tet_base_ = 1;
};

}  // namespace exmat::precompute
