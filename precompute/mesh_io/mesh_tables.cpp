#include "precompute/mesh_io/mesh_tables.h"

#include <fmt/format.h>
#include <limits>

#include "common/surface_io/mesh_arrays.h"

namespace exmat::precompute {
namespace {

// Indices of vertices and tets are 32-bit.
constexpr std::int64_t kMaxRows = std::numeric_limits<std::int32_t>::max();
constexpr std::int64_t kMaxFurther = 100;

// The count line of a table: how many rows, and how many columns of each after those that are read.
struct TableHeader {
  std::int64_t rows = 0;
  int further = 0;
};

// Rows, columns, attributes and (of vertices) boundary markers.
TableHeader read_header(CommentedLines& lines, std::string_view rows, int columns) {
  const std::string expected = fmt::format("the number of {}, then {}", rows, columns);
  if (!lines.current()) lines.fail(expected);
  Fields fields(lines.current()->text);
  const auto row_count = parse_integer(fields.next());
  if (!row_count || *row_count < 1 || *row_count > kMaxRows)
    lines.fail(fmt::format("the number of {} (1 to {})", rows, kMaxRows));
  TableHeader header{*row_count};
  if (parse_integer(fields.next()).value_or(0) != columns) lines.fail(expected);
  for (auto field = fields.next(); !field.empty(); field = fields.next()) {
    const auto further = parse_integer(field);
    if (!further || *further < 0 || *further > kMaxFurther)
      lines.fail(expected + " and the numbers of further columns");
    header.further += static_cast<int>(*further);
  }
  lines.advance();
  return header;
}

void check_row_id(const FileLine& line, Fields& fields, std::string_view row, std::int64_t index, std::int64_t rows,
                  std::int64_t& base) {
  const std::string_view field = fields.next();
  const auto id = parse_integer(field);
  if (index == 0 && id && (*id == 0 || *id == 1)) base = *id;
  if (id && *id == base + index) return;
  const std::string expected = index == 0 ? fmt::format("{} 0 or 1, the first of {}", row, rows)
                                          : fmt::format("{} {}, number {} of {}", row, base + index, index + 1, rows);
  fail_at(line, expected, quote(id ? field : line.text), id ? "ids count up by one from 0 or 1" : "");
}

std::int32_t read_index(const FileLine& line, std::string_view field, std::string_view what, std::int64_t base,
                        std::int64_t count) {
  const auto id = parse_integer(field);
  const std::int64_t last = base + count - 1;
  if (!id || *id < base || *id > last)
    fail_at(line, fmt::format("the id of a {} ({} to {})", what, base, last), quote(field));
  return static_cast<std::int32_t>(*id - base);
}

}  // namespace

void finish_row(const FileLine& line, Fields& fields, int further) {
  for (int column = 0; column < further; ++column)
    if (fields.next().empty()) fail_at(line, fmt::format("{} further columns, as declared above", further), quote(""));
  const std::string_view extra = fields.next();
  if (extra.empty()) return;
  // A number with a decimal comma is two fields of such a line.
  Fields words(line.text, Fields::Separators::kBlanks);
  for (auto word = words.next(); !word.empty(); word = words.next())
    if (const auto advice = advice_for_number(word); !word.ends_with(',') && !advice.empty())
      fail_at(line, "finite numbers", quote(word), advice);
  fail_at(line, "the end of the line", quote(extra));
}

void MeshTables::read_vertices(CommentedLines& lines) {
  const TableHeader header = read_header(lines, "vertices", 3);
  for (std::int64_t v = 0; v < header.rows; ++v) {
    if (!lines.current()) lines.fail(fmt::format("vertex {} of {}", v + 1, header.rows));
    const FileLine& line = *lines.current();
    Fields fields(line.text);
    check_row_id(line, fields, "vertex", v, header.rows, vertex_base_);
    auto& vertex = vertices_.emplace_back();
    vertex[0] = read_real(line, fields, "an x coordinate");
    vertex[1] = read_real(line, fields, "a y coordinate");
    vertex[2] = read_real(line, fields, "a z coordinate");
    finish_row(line, fields, header.further);
    lines.advance();
  }
}

void MeshTables::read_tets(CommentedLines& lines) {
  const TableHeader header = read_header(lines, "elements", 4);
  for (std::int64_t t = 0; t < header.rows; ++t) {
    if (!lines.current()) lines.fail(fmt::format("tet {} of {}", t + 1, header.rows));
    const FileLine& line = *lines.current();
    Fields fields(line.text);
    check_row_id(line, fields, "tet", t, header.rows, tet_base_);
    auto& tet = tets_.emplace_back();
    for (auto& corner : tet) corner = read_index(line, fields.next(), "vertex", vertex_base_, vertex_count());
    finish_row(line, fields, header.further);
    if (header.further > 0) last_columns_.push_back(line.text.substr(line.text.find_last_of(" \t,") + 1));
    lines.advance();
  }
}

std::int32_t MeshTables::tet_index(const FileLine& line, std::string_view id) const {
  return read_index(line, id, "tet", tet_base_, tet_count());
}

TetMesh MeshTables::mesh() const { return {vertex_array(vertices_), tet_array(tets_)}; }

}  // namespace exmat::precompute
