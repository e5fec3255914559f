#include "precompute/mesh_io/veg_reader.h"

#include <algorithm>
#include <fmt/format.h>
#include <string>

#include "common/core/log.h"
#include "common/surface_io/commented_lines.h"
#include "common/surface_io/text_input.h"
#include "precompute/mesh_io/mesh_tables.h"

namespace exmat::precompute {
namespace {

constexpr std::string_view kWholeMesh = "allElements";

struct VegMaterial {
  double density, youngs_modulus, poisson_ratio;
};

struct VegRegion {
  FileLine line;
  std::string set, material;
};

class VegReader {
 public:
  explicit VegReader(const std::filesystem::path& file) : lines_(file, "a .veg file", "*INCLUDE") {}
  MeshFile read();

 private:
  void read_section();
  void read_vertices();
  void read_elements(std::string_view type);
  void read_material(std::string_view name);
  void read_set(std::string_view name);
  void read_region();
  void assign_materials(MeshFile& mesh_file) const;
  void fill_region(const VegRegion& region, std::vector<const VegMaterial*>& material_of_tet) const;

  CommentedLines lines_;
  MeshTables tables_;
  std::map<std::string, VegMaterial, std::less<>> materials_;
  std::map<std::string, std::vector<std::int32_t>> sets_;
  std::vector<VegRegion> regions_;
};

std::string_view after_keyword(std::string_view line, std::string_view keyword) {
  line.remove_prefix(keyword.size());
  const std::size_t begin = line.find_first_not_of(" \t,");
  return begin == std::string_view::npos ? std::string_view{} : line.substr(begin);
}

MeshFile VegReader::read() {
  while (lines_.current()) read_section();
  if (tables_.vertex_count() == 0) lines_.fail("a *VERTICES section");
  if (tables_.tet_count() == 0) lines_.fail("an *ELEMENTS section");
  MeshFile result;
  result.mesh = tables_.mesh();
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
  if (tables_.vertex_count() > 0) lines_.fail("one *VERTICES section");
  lines_.advance();
  tables_.read_vertices(lines_);
}

void VegReader::read_elements(std::string_view type) {
  if (tables_.vertex_count() == 0) lines_.fail("*VERTICES before the elements");
  if (tables_.tet_count() > 0) lines_.fail("one section of elements");
  lines_.advance();
  if (!type.empty()) {
    if (!type.starts_with("TET")) lines_.fail("elements of type TET");
    return tables_.read_tets(lines_);
  }
  if (!lines_.current() || !lines_.current()->text.starts_with("TET"))
    lines_.fail("the element type TET", "only tetrahedra are supported");
  lines_.advance();
  tables_.read_tets(lines_);
}

void VegReader::read_material(std::string_view name) {
  const FileLine start = *lines_.current();
  if (name.empty()) lines_.fail("*MATERIAL and a name");
  lines_.advance();
  if (!lines_.current()) lines_.fail("'ENU, density, E, nu' after *MATERIAL");
  Fields fields(lines_.current()->text);
  if (fields.next() != "ENU") lines_.fail("a material of the form 'ENU, density, E, nu'", "only ENU is supported");
  VegMaterial material{};
  material.density = read_real(*lines_.current(), fields, "a density");
  material.youngs_modulus = read_real(*lines_.current(), fields, "Young's modulus");
  material.poisson_ratio = read_real(*lines_.current(), fields, "Poisson's ratio");
  finish_row(*lines_.current(), fields, 0);
  if (!(material.density > 0)) lines_.fail("a density above 0 kg/m^3");
  if (!(material.youngs_modulus > 0)) lines_.fail("Young's modulus above 0 Pa");
  if (!(material.poisson_ratio > -1 && material.poisson_ratio < 0.5)) lines_.fail("Poisson's ratio in (-1, 0.5)");
  if (!materials_.emplace(name, material).second)
    fail_at(start, "a name for each material", quote(name) + " a second time");
  lines_.advance();
}

void VegReader::read_set(std::string_view name) {
  if (name.empty()) lines_.fail("*SET and a name");
  if (tables_.tet_count() == 0) lines_.fail("the elements before a *SET of them");
  if (name == kWholeMesh || sets_.contains(std::string(name)))
    lines_.fail("a name for each set", quote(name) + " is taken");
  auto& tets = sets_[std::string(name)];
  lines_.advance();
  for (; lines_.current() && !lines_.current()->text.starts_with('*'); lines_.advance()) {
    Fields fields(lines_.current()->text);
    for (auto field = fields.next(); !field.empty(); field = fields.next())
      tets.push_back(tables_.tet_index(*lines_.current(), field));
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

void VegReader::fill_region(const VegRegion& region, std::vector<const VegMaterial*>& material_of_tet) const {
  const auto material = materials_.find(region.material);
  if (material == materials_.end()) fail_at(region.line, "a *MATERIAL of this file", quote(region.material));
  if (region.set == kWholeMesh) {
    std::fill(material_of_tet.begin(), material_of_tet.end(), &material->second);
    return;
  }
  const auto set = sets_.find(region.set);
  if (set == sets_.end()) fail_at(region.line, "allElements or a *SET of this file", quote(region.set));
  for (const std::int32_t tet : set->second) material_of_tet[static_cast<std::size_t>(tet)] = &material->second;
}

void VegReader::assign_materials(MeshFile& mesh_file) const {
  std::vector<const VegMaterial*> material_of_tet(static_cast<std::size_t>(tables_.tet_count()), nullptr);
  for (const VegRegion& region : regions_) fill_region(region, material_of_tet);
  if (materials_.empty()) return;
  const auto without = std::count(material_of_tet.begin(), material_of_tet.end(), nullptr);
  if (without > 0) {
    log::warning(fmt::format("{}: {} of {} tets are in no *REGION; the materials of the file are not used",
                             lines_.files().front().string(), without, tables_.tet_count()));
    return;
  }
  const Eigen::Index count = tables_.tet_count();
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
