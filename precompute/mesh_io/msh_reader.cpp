#include "precompute/mesh_io/msh_reader.h"

#include <algorithm>
#include <array>
#include <bit>
#include <fmt/format.h>
#include <limits>
#include <set>

#include "common/core/input_file.h"
#include "common/core/log.h"
#include "common/surface_io/mesh_arrays.h"
#include "common/surface_io/text_input.h"
#include "precompute/mesh_io/msh_contents.h"

namespace exmat::precompute {
namespace {

enum class Version { k22, k41 };

// The integer 1, as a file of the other byte order holds it.
constexpr std::int32_t kForeignOne = 0x01000000;

void read_byte_order(MshCursor& cursor) {
  cursor.set_binary(false);
  const std::int32_t one = cursor.read_int("the integer 1, which tells the byte order");
  if (one != 1 && one != kForeignOne) cursor.fail("the integer 1, which tells the byte order", fmt::format("{}", one));
  cursor.set_binary(one == kForeignOne);
}

constexpr const char* kConvert = "convert it with 'gmsh IN.msh -save -format msh41 -o OUT.msh'";

Version read_format(MshCursor& cursor) {
  const std::string_view first = cursor.begin_section();
  if (first == "NOD" || first == "PARA") cursor.fail("version 2.2 or 4.1", "version 1", kConvert);
  if (first != "MeshFormat") cursor.fail("$MeshFormat", "another beginning", "is this a Gmsh .msh file?");
  Fields fields(cursor.read_text_line("'version file-type data-size'"));
  const auto version_field = fields.next();
  const auto version = parse_real(version_field);
  if (version != 2.2 && version != 4.1) cursor.fail("version 2.2 or 4.1", quote(version_field), kConvert);
  const auto type_field = fields.next();
  const auto type = parse_integer(type_field);
  if (type != 0 && type != 1) cursor.fail("file type 0 (text) or 1 (binary)", quote(type_field));
  const auto size_field = fields.next();
  if (parse_integer(size_field) != 8) cursor.fail("data size 8", quote(size_field));
  if (type == 1) read_byte_order(cursor);
  cursor.end_section("MeshFormat");
  return version == 2.2 ? Version::k22 : Version::k41;
}

void read_physical_name(MshCursor& cursor, MshContents& contents) {
  const std::string expected = "'dimension tag \"name\"'";
  const std::string_view line = cursor.read_text_line(expected);
  Fields fields(line);
  const auto dimension = parse_integer(fields.next());
  const auto tag = parse_integer(fields.next());
  const std::size_t begin = line.find('"'), end = line.rfind('"');
  constexpr std::int64_t kMostTag = std::numeric_limits<std::int32_t>::max();
  const bool has_tag = tag && *tag > -kMostTag && *tag <= kMostTag;
  if (!dimension || !has_tag || begin >= end || end == std::string_view::npos) cursor.fail(expected, quote(line));
  if (dimension == 3) contents.volume_names[static_cast<std::int32_t>(*tag)] = line.substr(begin + 1, end - begin - 1);
}

void read_physical_names(MshCursor& cursor, MshContents& contents) {
  const std::uint64_t count = cursor.read_text_count("physical names", 7, 7);
  for (std::uint64_t i = 0; i < count; ++i) read_physical_name(cursor, contents);
}

void read_nodes(MshCursor& cursor, Version version, MshContents& contents) {
  if (!contents.nodes.empty()) cursor.fail("one $Nodes section", "a second one");
  version == Version::k22 ? read_nodes_22(cursor, contents) : read_nodes_41(cursor, contents);
}

void read_elements(MshCursor& cursor, Version version, MshContents& contents) {
  if (contents.nodes.empty()) cursor.fail("$Nodes before $Elements", "none");
  if (!contents.tets.empty()) cursor.fail("one $Elements section", "a second one");
  version == Version::k22 ? read_elements_22(cursor, contents) : read_elements_41(cursor, contents);
}

void read_section(MshCursor& cursor, std::string_view section, Version version, MshContents& contents) {
  if (section == "PartitionedEntities")
    cursor.fail("a mesh in one piece", "a partitioned one", "save it without partitions");
  if (section == "ParametricNodes")
    cursor.fail("a $Nodes section", "$ParametricNodes", "save the mesh with Mesh.SaveParametric = 0");
  if (section == "PhysicalNames")
    read_physical_names(cursor, contents);
  else if (section == "Entities" && version == Version::k41)
    read_entities_41(cursor, contents);
  else if (section == "Nodes")
    read_nodes(cursor, version, contents);
  else if (section == "Elements")
    read_elements(cursor, version, contents);
  else
    cursor.skip_section(section);
  cursor.end_section(section);
}

/// Elements that are no tetrahedra (Gmsh's manual, "MSH file format").
struct CellKind {
  const char* name;
  int dimension;
  std::array<std::int32_t, 8> types;  // and 0, which is none
};
constexpr std::array<CellKind, 7> kCellKinds{{{"points", 0, {15}},
                                              {"lines", 1, {1, 8, 26, 27, 28}},
                                              {"triangles", 2, {2, 9, 20, 21, 22, 23, 24, 25}},
                                              {"quadrangles", 2, {3, 10, 16}},
                                              {"hexahedra", 3, {5, 12, 17}},
                                              {"prisms", 3, {6, 13, 18}},
                                              {"pyramids", 3, {7, 14, 19}}}};

/// "12 triangles (element type 2)" for all of the file's that have at least this dimension.
std::vector<std::string> other_cells(const MshContents& contents, int dimension) {
  std::vector<std::string> cells;
  for (const auto& [type, count] : contents.skipped)
    for (const CellKind& kind : kCellKinds)
      if (kind.dimension >= dimension && std::ranges::find(kind.types, type) != kind.types.end())
        cells.push_back(fmt::format("{} {} (element type {})", count, kind.name, type));
  return cells;
}

MshContents read_contents(MshCursor& cursor) {
  const Version version = read_format(cursor);
  MshContents contents;
  std::set<std::string_view> sections;
  for (auto section = cursor.begin_section(); !section.empty(); section = cursor.begin_section()) {
    sections.insert(section);
    read_section(cursor, section, version, contents);
  }
  for (const auto required : {"Nodes", "Elements"})
    if (!sections.contains(required)) cursor.fail(fmt::format("a ${} section", required), "the end of the file");
  if (contents.tets.empty()) {
    const std::vector<std::string> cells = other_cells(contents, 0);
    cursor.fail("tetrahedra (element type 4)", cells.empty() ? "none" : fmt::format("{}", fmt::join(cells, ", ")),
                other_cells(contents, 3).empty()
                    ? "make the volume mesh with 'gmsh -3'"
                    : "fill the volume with tetrahedra: 'gmsh -3' without recombination or extruded layers");
  }
  return contents;
}

void warn_of_skipped(const std::filesystem::path& file, const MshContents& contents) {
  for (const std::string& cells : other_cells(contents, 3))
    log::warning(fmt::format("{}: {} are left out; only tetrahedra are used", file.string(), cells));
}

MeshFile to_mesh_file(const std::filesystem::path& file, MshContents contents) {
  MeshFile result;
  result.mesh = {contents.nodes.positions(), tet_array(contents.tets)};
  for (const auto& [tag, tets] : contents.volume_groups) {
    const auto name = contents.volume_names.find(tag);
    auto& set = result.tet_sets[name != contents.volume_names.end() ? name->second : std::to_string(tag)];
    set.insert(set.end(), tets.begin(), tets.end());
    std::sort(set.begin(), set.end());
    set.erase(std::unique(set.begin(), set.end()), set.end());
  }
  result.files = {file};
  return result;
}

}  // namespace

MeshFile read_msh(const std::filesystem::path& file) {
  const std::string bytes = read_text_file(file, "a .msh file");
  MshCursor cursor(file.string(), bytes);
  MshContents contents = read_contents(cursor);
  warn_of_skipped(file, contents);
  return to_mesh_file(file, std::move(contents));
}

}  // namespace exmat::precompute
