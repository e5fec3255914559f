#include "precompute/mesh_io/veg_reader.h"

#include <algorithm>
#include <array>
#include <fmt/format.h>
#include <limits>
#include <string>

#include "common/core/log.h"
#include "precompute/mesh_io/text_input.h"
#include "precompute/mesh_io/veg_lines.h"

namespace exmat::precompute {
namespace {

constexpr std::string_view kAllElements = "allElements";

struct VegMaterial {
  double density, youngs_modulus, poisson_ratio;
};

struct VegRegion {
  VegLine line;
  std::string set, material;
};

/// The count line of a table: how many rows, and how many columns of each to skip at its end.
struct TableHeader {
  std::int64_t rows = 0;
  int skipped_columns = 0;
};

class VegReader {
 public:
  explicit VegReader(const std::filesystem::path& file) : lines_(file) {}
  MeshFile read();

 private:
  void read_section();
  void read_vertices();
  void read_elements(std::string_view type);
  void read_element_table();
  void read_material(std::string_view name);
  void read_set(std::string_view name);
  void read_region();

  TableHeader read_header(std::string_view rows, int columns);
  void check_row_id(Fields& fields, std::string_view row, std::int64_t index, std::int64_t rows, std::int64_t& base);
  void finish_row(Fields& fields, int skipped_columns) const;
  double read_real(Fields& fields, std::string_view what) const;
  std::int32_t read_index(std::string_view field, std::string_view what, std::int64_t base, std::size_t count) const;
  void assign_materials(MeshFile& mesh_file) const;
  void fill_region(const VegRegion& region, std::vector<const VegMaterial*>& material_of_tet) const;

  VegLines lines_;
  std::vector<std::array<double, 3>> vertices_;
  std::vector<std::array<std::int32_t, 4>> tets_;
  std::int64_t vertex_base_ = 1, tet_base_ = 1;
  std::map<std::string, VegMaterial, std::less<>> materials_;
  std::map<std::string, std::vector<std::int32_t>> sets_;
  std::vector<VegRegion> regions_;
};

// Indices of vertices and tets are 32-bit.
constexpr std::int64_t kMaxRows = std::numeric_limits<std::int32_t>::max();

std::string_view after_keyword(std::string_view line, std::string_view keyword) {
  line.remove_prefix(keyword.size());
  const std::size_t begin = line.find_first_not_of(" \t,");
  return begin == std::string_view::npos ? std::string_view{} : line.substr(begin);
}

MeshFile VegReader::read() {
  while (lines_.current()) read_section();
  if (vertices_.empty()) lines_.fail("a *VERTICES section");
  if (tets_.empty()) lines_.fail("an *ELEMENTS section");
  MeshFile result;
  result.mesh.vertices.resize(static_cast<Eigen::Index>(vertices_.size()), 3);
  for (std::size_t v = 0; v < vertices_.size(); ++v)
    for (int axis = 0; axis < 3; ++axis) result.mesh.vertices(static_cast<Eigen::Index>(v), axis) = vertices_[v][axis];
  result.mesh.tets.resize(static_cast<Eigen::Index>(tets_.size()), 4);
  for (std::size_t t = 0; t < tets_.size(); ++t)
    for (int corner = 0; corner < 4; ++corner)
      result.mesh.tets(static_cast<Eigen::Index>(t), corner) = tets_[t][corner];
  assign_materials(result);
  result.tet_sets = std::move(sets_);
  result.files = lines_.files();
  return result;
}

void VegReader::read_section() {
  const std::string_view line = lines_.current()->text;
  const std::string_view keyword = Fields(line).next();
  const std::string_view argument = after_keyword(line, keyword);
  if (keyword == "*VERTICES") return read_vertices();
  if (keyword == "*ELEMENTS") return read_elements(argument);
  if (keyword == "*TETS") return read_elements("TET");
  if (keyword == "*MATERIAL") return read_material(argument);
  if (keyword == "*SET") return read_set(argument);
  if (keyword == "*REGION") return read_region();
  lines_.fail("*VERTICES, *ELEMENTS, *TETS, *MATERIAL, *SET, *REGION or *INCLUDE",
              keyword.starts_with('*') ? "" : "check the count that the section above declares");
}

void VegReader::read_vertices() {
  if (!vertices_.empty()) lines_.fail("one *VERTICES section");
  lines_.advance();
  const TableHeader header = read_header("vertices", 3);
  for (std::int64_t v = 0; v < header.rows; ++v) {
    if (!lines_.current()) lines_.fail(fmt::format("vertex {} of {}", v + 1, header.rows));
    Fields fields(lines_.current()->text);
    check_row_id(fields, "vertex", v, header.rows, vertex_base_);
    auto& vertex = vertices_.emplace_back();
    vertex[0] = read_real(fields, "an x coordinate");
    vertex[1] = read_real(fields, "a y coordinate");
    vertex[2] = read_real(fields, "a z coordinate");
    finish_row(fields, header.skipped_columns);
    lines_.advance();
  }
}

void VegReader::read_elements(std::string_view type) {
  if (vertices_.empty()) lines_.fail("*VERTICES before the elements");
  if (!tets_.empty()) lines_.fail("one section of elements");
  lines_.advance();
  if (!type.empty()) {
    if (!type.starts_with("TET")) lines_.fail("elements of type TET");
    return read_element_table();
  }
  if (!lines_.current() || !lines_.current()->text.starts_with("TET"))
    lines_.fail("the element type TET", "only tetrahedra are supported");
  lines_.advance();
  read_element_table();
}

void VegReader::read_element_table() {
  const TableHeader header = read_header("elements", 4);
  for (std::int64_t t = 0; t < header.rows; ++t) {
    if (!lines_.current()) lines_.fail(fmt::format("tet {} of {}", t + 1, header.rows));
    Fields fields(lines_.current()->text);
    check_row_id(fields, "tet", t, header.rows, tet_base_);
    auto& tet = tets_.emplace_back();
    for (auto& corner : tet) corner = read_index(fields.next(), "vertex", vertex_base_, vertices_.size());
    finish_row(fields, header.skipped_columns);
    lines_.advance();
  }
}

void VegReader::read_material(std::string_view name) {
  const VegLine start = *lines_.current();
  if (name.empty()) lines_.fail("*MATERIAL and a name");
  lines_.advance();
  if (!lines_.current()) lines_.fail("'ENU, density, E, nu' after *MATERIAL");
  Fields fields(lines_.current()->text);
  if (fields.next() != "ENU") lines_.fail("a material of the form 'ENU, density, E, nu'", "only ENU is supported");
  VegMaterial material{};
  material.density = read_real(fields, "a density");
  material.youngs_modulus = read_real(fields, "Young's modulus");
  material.poisson_ratio = read_real(fields, "Poisson's ratio");
  finish_row(fields, 0);
  if (!(material.density > 0)) lines_.fail("a density above 0 kg/m^3");
  if (!(material.youngs_modulus > 0)) lines_.fail("Young's modulus above 0 Pa");
  if (!(material.poisson_ratio > -1 && material.poisson_ratio < 0.5)) lines_.fail("Poisson's ratio in (-1, 0.5)");
  if (!materials_.emplace(name, material).second)
    fail_at(start, "a name for each material", quote(name) + " a second time");
  lines_.advance();
}

void VegReader::read_set(std::string_view name) {
  if (name.empty()) lines_.fail("*SET and a name");
  if (tets_.empty()) lines_.fail("the elements before a *SET of them");
  if (name == kAllElements || sets_.contains(std::string(name)))
    lines_.fail("a name for each set", quote(name) + " is taken");
  auto& tets = sets_[std::string(name)];
  lines_.advance();
  for (; lines_.current() && !lines_.current()->text.starts_with('*'); lines_.advance()) {
    Fields fields(lines_.current()->text);
    for (auto field = fields.next(); !field.empty(); field = fields.next())
      tets.push_back(read_index(field, "tet", tet_base_, tets_.size()));
  }
  std::sort(tets.begin(), tets.end());
  tets.erase(std::unique(tets.begin(), tets.end()), tets.end());
}

void VegReader::read_region() {
  lines_.advance();
  if (!lines_.current()) lines_.fail("'set, material' after *REGION");
  const std::string_view text = lines_.current()->text;
  const std::size_t split = text.find(',') != std::string_view::npos ? text.find(',') : text.find_first_of(" \t");
  const std::string_view set = trimmed(text.substr(0, split));
  const std::string_view material = split == std::string_view::npos ? "" : trimmed(text.substr(split + 1));
  if (set.empty() || material.empty()) lines_.fail("a region of the form 'set, material'");
  regions_.push_back({*lines_.current(), std::string(set), std::string(material)});
  lines_.advance();
}

// TetGen's header, which Vega took over: rows, columns, attributes and (of vertices) boundary markers.
TableHeader VegReader::read_header(std::string_view rows, int columns) {
  const std::string expected = fmt::format("the number of {}, then {}", rows, columns);
  if (!lines_.current()) lines_.fail(expected);
  Fields fields(lines_.current()->text);
  const auto row_count = parse_integer(fields.next());
  if (!row_count || *row_count < 1 || *row_count > kMaxRows)
    lines_.fail(fmt::format("the number of {} (1 to {})", rows, kMaxRows));
  TableHeader header{*row_count};
  if (parse_integer(fields.next()).value_or(0) != columns) lines_.fail(expected);
  for (auto field = fields.next(); !field.empty(); field = fields.next()) {
    const auto skipped = parse_integer(field);
    if (!skipped || *skipped < 0 || *skipped > 100) lines_.fail(expected + " and the numbers of further columns");
    header.skipped_columns += static_cast<int>(*skipped);
  }
  lines_.advance();
  return header;
}

void VegReader::check_row_id(Fields& fields, std::string_view row, std::int64_t index, std::int64_t rows,
                             std::int64_t& base) {
  const std::string_view field = fields.next();
  const auto id = parse_integer(field);
  if (index == 0 && id && (*id == 0 || *id == 1)) base = *id;
  if (id && *id == base + index) return;
  const std::string expected = index == 0 ? fmt::format("{} 0 or 1, the first of {}", row, rows)
                                          : fmt::format("{} {}, number {} of {}", row, base + index, index + 1, rows);
  fail_at(*lines_.current(), expected, quote(id ? field : lines_.current()->text),
          id ? "ids count up by one from 0 or 1" : "");
}

void VegReader::finish_row(Fields& fields, int skipped_columns) const {
  for (int column = 0; column < skipped_columns; ++column)
    if (fields.next().empty())
      fail_at(*lines_.current(), fmt::format("{} further columns, as declared above", skipped_columns), quote(""));
  const std::string_view extra = fields.next();
  if (!extra.empty()) fail_at(*lines_.current(), "the end of the line", quote(extra));
}

double VegReader::read_real(Fields& fields, std::string_view what) const {
  const std::string_view field = fields.next();
  const auto value = parse_real(field);
  if (!value) fail_at(*lines_.current(), fmt::format("{}, a finite number", what), quote(field));
  return *value;
}

std::int32_t VegReader::read_index(std::string_view field, std::string_view what, std::int64_t base,
                                   std::size_t count) const {
  const auto id = parse_integer(field);
  const std::int64_t last = base + static_cast<std::int64_t>(count) - 1;
  if (!id || *id < base || *id > last)
    fail_at(*lines_.current(), fmt::format("the id of a {} ({} to {})", what, base, last), quote(field));
  return static_cast<std::int32_t>(*id - base);
}

void VegReader::fill_region(const VegRegion& region, std::vector<const VegMaterial*>& material_of_tet) const {
  const auto material = materials_.find(region.material);
  if (material == materials_.end()) fail_at(region.line, "a *MATERIAL of this file", quote(region.material));
  if (region.set == kAllElements) {
    std::fill(material_of_tet.begin(), material_of_tet.end(), &material->second);
    return;
  }
  const auto set = sets_.find(region.set);
  if (set == sets_.end()) fail_at(region.line, "allElements or a *SET of this file", quote(region.set));
  for (const std::int32_t tet : set->second) material_of_tet[static_cast<std::size_t>(tet)] = &material->second;
}

void VegReader::assign_materials(MeshFile& mesh_file) const {
  std::vector<const VegMaterial*> material_of_tet(tets_.size(), nullptr);
  for (const VegRegion& region : regions_) fill_region(region, material_of_tet);
  if (materials_.empty()) return;
  const auto without = std::count(material_of_tet.begin(), material_of_tet.end(), nullptr);
  if (without > 0) {
    log::warning(fmt::format("{}: {} of {} tets are in no *REGION; the materials of the file are not used",
                             lines_.files().front().string(), without, tets_.size()));
    return;
  }
  const auto count = static_cast<Eigen::Index>(tets_.size());
  TetMaterials& materials = mesh_file.materials.emplace();
  materials.density.resize(count);
  materials.youngs_modulus.resize(count);
  materials.poisson_ratio.resize(count);
  for (Eigen::Index t = 0; t < count; ++t) {
    const VegMaterial& material = *material_of_tet[static_cast<std::size_t>(t)];
    materials.density[t] = material.density;
    materials.youngs_modulus[t] = material.youngs_modulus;
    materials.poisson_ratio[t] = material.poisson_ratio;
  }
}

}  // namespace

MeshFile read_veg(const std::filesystem::path& file) { return VegReader(file).read(); }

}  // namespace exmat::precompute
