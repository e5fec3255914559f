#include "precompute/mesh_io/vtk_reader.h"

#include <array>
#include <bit>
#include <fmt/format.h>
#include <set>
#include <utility>

#include "common/core/input_file.h"
#include "common/core/log.h"
#include "common/surface_io/mesh_arrays.h"
#include "common/surface_io/text_input.h"
#include "precompute/mesh_io/vtk_cursor.h"

namespace exmat::precompute {
namespace {

using Kind = NumberType::Kind;

constexpr std::int64_t kVertexCell = 1, kTetCell = 10, kFirstVolumeCell = 10;
constexpr std::array<std::int64_t, 3> kCurvedTetCells{24, 71, 78};  // quadratic, Lagrange, Bezier
constexpr std::size_t kMostRegions = 1000;
constexpr std::uint64_t kMostComponents = 1000;
// Attributes with a name and a type, and the numbers of each point or cell.
constexpr std::array<std::pair<std::string_view, std::uint64_t>, 6> kTypedAttributes{
    {{"VECTORS", 3}, {"NORMALS", 3}, {"TENSORS", 9}, {"TENSORS6", 6}, {"GLOBAL_IDS", 1}, {"PEDIGREE_IDS", 1}}};

std::string cell_name(std::int64_t type) {
  constexpr std::array<std::pair<std::int64_t, const char*>, 8> kNamed{{{3, "lines"},
                                                                        {5, "triangles"},
                                                                        {7, "polygons"},
                                                                        {9, "quadrilaterals"},
                                                                        {11, "voxels"},
                                                                        {12, "hexahedra"},
                                                                        {13, "prisms"},
                                                                        {14, "pyramids"}}};
  for (const auto& [known, name] : kNamed)
    if (known == type) return fmt::format("{} (cell type {})", name, type);
  return fmt::format("cells of type {}", type);
}

class VtkReader {
 public:
  VtkReader(const std::filesystem::path& file, std::string_view bytes) : file_(file), cursor_(file.string(), bytes) {}

  MeshFile read();

 private:
  using Words = VtkCursor::Words;

  void read_header();
  void read_section(const Words& words);
  void read_points(const Words& words);
  void read_cells(const Words& words);
  void read_rows(std::uint64_t cells, std::uint64_t size);
  void read_offsets(std::uint64_t offsets, std::uint64_t size);
  void read_cell_types(const Words& words);
  void read_data_count(const Words& words);
  bool read_attribute(const Words& words);
  void read_field(const Words& words);
  void read_array(std::string_view name, std::uint64_t components, std::uint64_t tuples, const NumberType& type);
  std::int32_t read_point_index(const NumberType& type);
  void check_tets() const;
  MeshFile result() const;

  std::filesystem::path file_;
  VtkCursor cursor_;
  bool has_offsets_ = false;
  std::vector<std::array<double, 3>> points_;
  std::vector<std::size_t> ends_;  // of each cell, in corners_
  std::vector<std::int32_t> corners_;
  std::vector<std::int64_t> types_;
  // The section of attributes: number of points or cells, and whether it is of cells.
  std::uint64_t attribute_count_ = 0;
  bool of_cells_ = false;
  std::map<std::string, std::vector<std::int64_t>> cell_numbers_;
};

MeshFile VtkReader::read() {
  read_header();
  for (Words words = cursor_.read_keywords(); !words[0].empty(); words = cursor_.read_keywords()) read_section(words);
  if (points_.empty()) cursor_.fail("POINTS", "the end of the file");
  if (ends_.empty()) cursor_.fail("CELLS", "the end of the file");
  if (types_.empty()) cursor_.fail("CELL_TYPES", "the end of the file");
  check_tets();
  return result();
}

void VtkReader::read_header() {
  const std::string_view first = cursor_.read_text_line("'# vtk DataFile Version'");
  constexpr std::string_view kMagic = "# vtk DataFile Version ";
  const auto version = first.starts_with(kMagic) ? parse_real(first.substr(kMagic.size())) : std::nullopt;
  if (!version || *version < 1 || *version >= 6)
    cursor_.fail("'# vtk DataFile Version' and 1 to 5.1", quote(first), "is this a legacy .vtk file?");
  has_offsets_ = *version >= 5;
  cursor_.read_text_line("a title");
  const std::string_view encoding = cursor_.read_text_line("ASCII or BINARY");
  if (encoding != "ASCII" && encoding != "BINARY") cursor_.fail("ASCII or BINARY", quote(encoding));
  if (encoding == "BINARY") cursor_.set_binary(std::endian::native == std::endian::little);
}

void VtkReader::read_section(const Words& words) {
  if (words[0] == "DATASET") {
    if (words[1] != "UNSTRUCTURED_GRID") cursor_.fail("DATASET UNSTRUCTURED_GRID", quote(words[1]));
  } else if (words[0] == "POINTS") {
    read_points(words);
  } else if (words[0] == "CELLS") {
    read_cells(words);
  } else if (words[0] == "CELL_TYPES") {
    read_cell_types(words);
  } else if (words[0] == "CELL_DATA" || words[0] == "POINT_DATA") {
    read_data_count(words);
  } else if (words[0] == "FIELD") {
    read_field(words);
  } else if (!read_attribute(words)) {
    cursor_.fail("a keyword of an unstructured grid", quote(words[0]), "check the counts of the section before it");
  }
}

void VtkReader::read_points(const Words& words) {
  if (!points_.empty()) cursor_.fail("POINTS once", "a second time");
  const std::uint64_t count = cursor_.number(words[1], "points");
  const NumberType type = cursor_.type(words[2]);
  cursor_.check_values(count, type, "points");
  cursor_.check_values(3 * count, type, "coordinates");
  for (std::uint64_t k = 0; k < count; ++k) {
    auto& point = points_.emplace_back();
    point[0] = cursor_.read_real_of(type, "an x coordinate");
    point[1] = cursor_.read_real_of(type, "a y coordinate");
    point[2] = cursor_.read_real_of(type, "a z coordinate");
  }
}

void VtkReader::read_cells(const Words& words) {
  if (points_.empty()) cursor_.fail("POINTS before CELLS", "none");
  if (!ends_.empty()) cursor_.fail("CELLS once", "a second time");
  const std::uint64_t count = cursor_.number(words[1], "cells"), size = cursor_.number(words[2], "values");
  has_offsets_ ? read_offsets(count, size) : read_rows(count, size);
}

std::int32_t VtkReader::read_point_index(const NumberType& type) {
  const auto count = static_cast<std::int64_t>(points_.size());
  const std::string expected = fmt::format("a point from 0 to {}", count - 1);
  const std::int64_t index = cursor_.read_integer_of(type, expected);
  if (index < 0 || index >= count) cursor_.fail(expected, fmt::format("{}", index));
  return static_cast<std::int32_t>(index);
}

// Rows of a number of corners and these, as before version 5.
void VtkReader::read_rows(std::uint64_t cells, std::uint64_t size) {
  const NumberType type = cursor_.type("int");
  cursor_.check_values(cells, type, "cells");
  cursor_.check_values(size, type, "values of cells");
  for (std::uint64_t cell = 0; cell < cells; ++cell) {
    const std::int64_t corners = cursor_.read_integer_of(type, "the number of a cell's points");
    const std::uint64_t left = size - corners_.size() - ends_.size();
    if (corners < 0 || static_cast<std::uint64_t>(corners) >= left)
      cursor_.fail(fmt::format("a cell of 0 to {} points, for CELLS declares {} values", std::int64_t(left) - 1, size),
                   fmt::format("{}", corners));
    for (std::int64_t k = 0; k < corners; ++k) corners_.push_back(read_point_index(type));
    ends_.push_back(corners_.size());
  }
  if (corners_.size() + ends_.size() != size)
    cursor_.fail(fmt::format("{} values of CELLS", size), fmt::format("{}", corners_.size() + ends_.size()));
}

// Reads the offsets, the begin of each cell's corners and after them the end of the last; then the corners.
void VtkReader::read_offsets(std::uint64_t offsets, std::uint64_t size) {
  Words words = cursor_.read_keywords();
  if (words[0] != "OFFSETS") cursor_.fail("OFFSETS after CELLS", quote(words[0]));
  const NumberType offset_type = cursor_.type(words[1]);
  cursor_.check_values(offsets, offset_type, "offsets of cells");
  std::int64_t last = 0;
  for (std::uint64_t k = 0; k < offsets; ++k) {
    const std::int64_t offset = cursor_.read_integer_of(offset_type, "an offset of a cell");
    const bool fits = k == 0 ? offset == 0 : offset >= last && static_cast<std::uint64_t>(offset) <= size;
    if (!fits)
      cursor_.fail(k == 0 ? "0, the first offset" : fmt::format("an offset from {} to {}", last, size),
                   fmt::format("{}", offset));
    if (k > 0) ends_.push_back(static_cast<std::size_t>(offset));
    last = offset;
  }
  if (static_cast<std::uint64_t>(last) != size)
    cursor_.fail(fmt::format("{}, the last offset", size), fmt::format("{}", last));
  words = cursor_.read_keywords();
  if (words[0] != "CONNECTIVITY") cursor_.fail("CONNECTIVITY after OFFSETS", quote(words[0]));
  const NumberType type = cursor_.type(words[1]);
  cursor_.check_values(size, type, "points of cells");
  for (std::uint64_t k = 0; k < size; ++k) corners_.push_back(read_point_index(type));
}

void VtkReader::read_cell_types(const Words& words) {
  const std::uint64_t count = cursor_.number(words[1], "cell types");
  if (count != ends_.size()) cursor_.fail(fmt::format("CELL_TYPES {}, as of CELLS", ends_.size()), quote(words[1]));
  if (!types_.empty()) cursor_.fail("CELL_TYPES once", "a second time");
  for (std::size_t cell = 0; cell < ends_.size(); ++cell) {
    const std::int64_t type = cursor_.read_integer_of(cursor_.type("int"), "the type of a cell");
    types_.push_back(type);
    const std::size_t corners = ends_[cell] - (cell == 0 ? 0 : ends_[cell - 1]);
    if (type == kTetCell && corners != 4)
      cursor_.fail("4 points of a tet (cell type 10)", fmt::format("{} of cell {}", corners, cell));
    // Also what is left of a tet's 10 where the file is cut off.
    if (type == kVertexCell && corners != 1)
      cursor_.fail("1 point of a vertex (cell type 1)", fmt::format("{} of cell {}", corners, cell),
                   "is the file cut off?");
    if (std::ranges::find(kCurvedTetCells, type) != kCurvedTetCells.end())
      cursor_.fail("tets of first order (cell type 10)", fmt::format("tets of higher order (cell type {})", type));
  }
}

void VtkReader::read_data_count(const Words& words) {
  of_cells_ = words[0] == "CELL_DATA";
  attribute_count_ = cursor_.number(words[1], of_cells_ ? "cells" : "points");
  const std::size_t expected = of_cells_ ? ends_.size() : points_.size();
  if (expected == 0) cursor_.fail(fmt::format("{} before {}", of_cells_ ? "CELLS" : "POINTS", words[0]), "none");
  if (attribute_count_ != expected) cursor_.fail(fmt::format("{} {}", words[0], expected), quote(words[1]));
}

// One array of the section of attributes; false where the keyword is none of them.
bool VtkReader::read_attribute(const Words& words) {
  const std::string_view keyword = words[0];
  for (const auto& [name, components] : kTypedAttributes)
    if (keyword == name) {
      cursor_.skip_values(components * attribute_count_, cursor_.type(words[2]), "a value");
      return true;
    }
  if (keyword == "SCALARS") {
    const std::uint64_t components = words[3].empty() ? 1 : cursor_.number(words[3], "components (1 to 4)");
    const Words table = cursor_.read_keywords();
    if (table[0] != "LOOKUP_TABLE") cursor_.fail("LOOKUP_TABLE after SCALARS", quote(table[0]));
    read_array(words[1], components, attribute_count_, cursor_.type(words[2]));
    return true;
  }
  const NumberType colours = cursor_.type(cursor_.is_binary() ? "unsigned_char" : "float");
  if (keyword == "LOOKUP_TABLE") {
    read_array(words[1], 4, cursor_.number(words[2], "colours"), colours);
  } else if (keyword == "COLOR_SCALARS") {
    read_array(words[1], cursor_.number(words[2], "components"), attribute_count_, colours);
  } else if (keyword == "TEXTURE_COORDINATES") {
    read_array(words[1], cursor_.number(words[2], "components"), attribute_count_, cursor_.type(words[3]));
  } else {
    return false;
  }
  return true;
}

void VtkReader::read_field(const Words& words) {
  const std::uint64_t arrays = cursor_.number(words[2], "arrays");
  for (std::uint64_t k = 0; k < arrays; ++k) {
    const Words array = cursor_.read_keywords();
    if (array[0].empty()) cursor_.fail(fmt::format("array {} of {}", k + 1, arrays), "the end of the file");
    read_array(array[0], cursor_.number(array[1], "components"), cursor_.number(array[2], "tuples"),
               cursor_.type(array[3]));
  }
}

// Keeps integers of cells, one each.
void VtkReader::read_array(std::string_view name, std::uint64_t components, std::uint64_t tuples,
                           const NumberType& type) {
  if (components > kMostComponents)
    cursor_.fail(fmt::format("at most {} components", kMostComponents), fmt::format("{}", components));
  cursor_.check_values(tuples, type, "values");
  const bool is_region = of_cells_ && components == 1 && tuples == attribute_count_ &&
                         (type.kind == Kind::kSigned || type.kind == Kind::kUnsigned);
  if (!is_region) return cursor_.skip_values(components * tuples, type, "a value");
  std::vector<std::int64_t>& numbers = cell_numbers_[std::string(name)];
  numbers.clear();
  for (std::uint64_t k = 0; k < tuples; ++k) numbers.push_back(cursor_.read_integer_of(type, "an integer"));
}

void VtkReader::check_tets() const {
  std::map<std::int64_t, std::size_t> counts;
  for (const std::int64_t type : types_) ++counts[type];
  if (!counts.contains(kTetCell)) {
    std::string cells;
    for (const auto& [type, count] : counts)
      cells += fmt::format("{}{} {}", cells.empty() ? "" : ", ", count, cell_name(type));
    cursor_.fail("tets (cell type 10)", cells.empty() ? "none" : cells, "fill the volume with tetrahedra");
  }
  for (const auto& [type, count] : counts)
    if (type > kFirstVolumeCell)
      log::warning(
          fmt::format("{}: {} {} are left out; only tetrahedra are used", file_.string(), count, cell_name(type)));
}

MeshFile VtkReader::result() const {
  std::vector<std::array<std::int32_t, 4>> tets;
  std::vector<std::size_t> cells;
  for (std::size_t cell = 0; cell < types_.size(); ++cell) {
    if (types_[cell] != kTetCell) continue;
    cells.push_back(cell);
    auto& tet = tets.emplace_back();
    std::copy_n(corners_.begin() + static_cast<std::ptrdiff_t>(ends_[cell]) - 4, 4, tet.begin());
  }
  MeshFile result;
  result.mesh = {vertex_array(points_), tet_array(tets)};
  for (const auto& [name, numbers] : cell_numbers_) {
    if (std::set<std::int64_t>(numbers.begin(), numbers.end()).size() > kMostRegions) continue;
    for (std::size_t t = 0; t < cells.size(); ++t)
      result.tet_sets[fmt::format("{} {}", name, numbers[cells[t]])].push_back(static_cast<std::int32_t>(t));
  }
  result.files = {file_};
  return result;
}

}  // namespace

MeshFile read_vtk(const std::filesystem::path& file) {
  const std::string bytes = read_text_file(file, "a legacy .vtk file");
  return VtkReader(file, bytes).read();
}

}  // namespace exmat::precompute
