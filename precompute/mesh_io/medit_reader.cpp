#include "precompute/mesh_io/medit_reader.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <fmt/format.h>

#include "common/core/input_file.h"
#include "common/core/log.h"
#include "common/surface_io/mesh_arrays.h"
#include "common/surface_io/text_input.h"
#include "common/surface_io/value_cursor.h"

namespace exmat::precompute {
namespace {

constexpr std::array<std::string_view, 3> kOtherVolumes{"Hexahedra", "Prisms", "Pyramids"};

class MeditReader {
 public:
  MeditReader(const std::filesystem::path& file, std::string_view bytes)
      : file_(file), cursor_(file.string(), bytes, ValueCursor::Layout::kAnywhere, '#') {}

  MeshFile read();

 private:
  void read_header();
  std::string_view read_section(std::string_view keyword);
  void read_vertices();
  void read_tets();
  std::string_view next_keyword();
  std::string_view skip_values();

  std::filesystem::path file_;
  ValueCursor cursor_;
  std::vector<std::array<double, 3>> vertices_;
  std::vector<std::array<std::int32_t, 4>> tets_;
  std::vector<std::int64_t> references_;
  std::string others_;  // volume elements that are left out
};

bool is_keyword(std::string_view word) { return std::isalpha(static_cast<unsigned char>(word[0])) != 0; }

MeshFile MeditReader::read() {
  read_header();
  for (auto keyword = next_keyword(); keyword != "End";) keyword = read_section(keyword);
  if (vertices_.empty()) cursor_.fail("Vertices before End", "none");
  if (tets_.empty())
    cursor_.fail("Tetrahedra before End", others_.empty() ? "none" : others_,
                 others_.empty() ? "" : "fill the volume with tetrahedra");
  const std::string_view extra = cursor_.read_word();
  if (!extra.empty()) cursor_.fail("nothing after End", quote(extra));
  MeshFile result;
  result.mesh = {vertex_array(vertices_), tet_array(tets_)};
  result.tet_sets = region_sets(references_);
  result.files = {file_};
  return result;
}

void MeditReader::read_header() {
  const std::string_view word = cursor_.read_word();
  if (word != "MeshVersionFormatted")
    cursor_.fail("MeshVersionFormatted", cursor_.describe(word), "is this a MEDIT .mesh file of text?");
  const std::int32_t version = cursor_.read_int("a version from 1 to 4");
  if (version < 1 || version > 4) cursor_.fail("a version from 1 to 4", fmt::format("{}", version));
}

// Returns the keyword after it.
std::string_view MeditReader::read_section(std::string_view keyword) {
  if (keyword == "Dimension") {
    const std::int32_t dimension = cursor_.read_int("the dimension, 3");
    if (dimension != 3) cursor_.fail("dimension 3", fmt::format("{}", dimension));
    return next_keyword();
  }
  if (keyword == "Vertices") {
    read_vertices();
    return next_keyword();
  }
  if (keyword == "Tetrahedra") {
    read_tets();
    return next_keyword();
  }
  if (keyword.starts_with("TetrahedraP")) cursor_.fail("Tetrahedra of first order", quote(keyword));
  if (std::ranges::find(kOtherVolumes, keyword) != kOtherVolumes.end()) {
    const std::uint64_t count = cursor_.read_size(fmt::format("the number of {}", keyword));
    log::warning(fmt::format("{}: {} {} are left out; only tetrahedra are used", file_.string(), count, keyword));
    others_ += fmt::format("{}{} {}", others_.empty() ? "" : ", ", count, keyword);
  }
  return skip_values();
}

void MeditReader::read_vertices() {
  if (!vertices_.empty()) cursor_.fail("one section Vertices", "a second one");
  const std::uint64_t count = cursor_.read_count("vertices", 8, 8);
  for (std::uint64_t v = 0; v < count; ++v) {
    auto& vertex = vertices_.emplace_back();
    vertex[0] = cursor_.read_real("an x coordinate");
    vertex[1] = cursor_.read_real("a y coordinate");
    vertex[2] = cursor_.read_real("a z coordinate");
    cursor_.read_int("a vertex's reference number");
  }
}

void MeditReader::read_tets() {
  if (!tets_.empty()) cursor_.fail("one section Tetrahedra", "a second one");
  if (vertices_.empty()) cursor_.fail("Vertices before Tetrahedra", "none");
  const std::uint64_t count = cursor_.read_count("tetrahedra", 10, 10);
  const auto last = static_cast<std::int32_t>(vertices_.size());
  const std::string expected = fmt::format("a vertex number from 1 to {}", last);
  for (std::uint64_t t = 0; t < count; ++t) {
    for (auto& corner : tets_.emplace_back()) {
      const std::int32_t number = cursor_.read_int(expected);
      if (number < 1 || number > last) cursor_.fail(expected, fmt::format("{}", number));
      corner = number - 1;
    }
    references_.push_back(cursor_.read_int("a tet's reference number"));
  }
}

std::string_view MeditReader::next_keyword() {
  const std::string_view word = cursor_.read_word();
  if (word.empty() || !is_keyword(word))
    cursor_.fail("a keyword, at last 'End'", cursor_.describe(word),
                 word.empty() ? "is the file cut off?" : "check the count of the section before it");
  return word;
}

// Passes over the values of a section that is not used to the next keyword.
std::string_view MeditReader::skip_values() {
  std::string_view word = cursor_.read_word();
  while (!word.empty() && !is_keyword(word)) word = cursor_.read_word();
  if (word.empty()) cursor_.fail("a keyword, at last 'End'", "the end of the file", "is the file cut off?");
  return word;
}

}  // namespace

MeshFile read_medit(const std::filesystem::path& file) {
  const std::string bytes = read_text_file(file, "a MEDIT .mesh file");
  return MeditReader(file, bytes).read();
}

}  // namespace exmat::precompute
