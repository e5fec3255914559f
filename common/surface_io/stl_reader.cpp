#include "common/surface_io/stl_reader.h"

#include <algorithm>
#include <array>
#include <bit>
#include <fmt/format.h>
#include <string>
#include <unordered_map>

#include "common/core/input_file.h"
#include "common/surface_io/mesh_arrays.h"
#include "common/surface_io/surface_parts.h"
#include "common/surface_io/text_input.h"
#include "common/surface_io/value_cursor.h"

namespace exmat {
namespace {

constexpr std::size_t kHeaderBytes = 80, kCountBytes = 4, kTriangleBytes = 50;

using Corner = std::array<double, 3>;

struct PointHash {
  std::size_t operator()(const Corner& point) const {
    std::uint64_t hash = 0;
    for (const double x : point) hash = (std::rotl(hash, 23) ^ std::bit_cast<std::uint64_t>(x)) * 0x9e3779b97f4a7c15U;
    return static_cast<std::size_t>(hash ^ (hash >> 32));
  }
};

std::string lower(std::string_view text) {
  std::string result(text);
  for (char& letter : result)
    if (letter >= 'A' && letter <= 'Z') letter = static_cast<char>(letter - 'A' + 'a');
  return result;
}

bool is_text(std::string_view bytes) {
  if (lower(bytes.substr(0, 5)) != "solid") return false;
  // A zero byte: no text has one, a binary file has some in its header or its count.
  return bytes.substr(0, kHeaderBytes + kCountBytes).find('\0') == std::string_view::npos;
}

class StlReader {
 public:
  StlReader(std::string file, std::string_view bytes)
      : bytes_(bytes), cursor_(std::move(file), bytes, ValueCursor::Layout::kAnywhere) {}

  SurfaceFile read();

 private:
  void read_binary();
  void read_text();
  void read_solid();
  void read_facet();
  void expect(std::string_view word);
  void add_triangle(const std::array<Corner, 3>& corners);

  std::string_view bytes_;
  ValueCursor cursor_;
  std::unordered_map<Corner, std::int32_t, PointHash> indices_;
  std::vector<Corner> vertices_;
  std::vector<std::array<std::int32_t, 3>> triangles_;
  SurfaceParts parts_;
};

SurfaceFile StlReader::read() {
  is_text(bytes_) ? read_text() : read_binary();
  if (triangles_.empty()) cursor_.fail("triangles", "none");
  SurfaceFile surface;
  surface.mesh = {vertex_array(vertices_), triangle_array(triangles_)};
  parts_.finish(surface, bytes_.size());
  return surface;
}

void StlReader::read_binary() {
  cursor_.set_binary(std::endian::native != std::endian::little);
  cursor_.read_bytes(kHeaderBytes, "a header of 80 bytes");
  const auto count = cursor_.read_binary<std::uint32_t>("the number of triangles");
  cursor_.check_count(count, "triangles", kTriangleBytes);
  for (std::uint32_t t = 0; t < count; ++t) {
    cursor_.read_bytes(3 * sizeof(float), "a normal");
    std::array<Corner, 3> corners{};
    for (Corner& corner : corners)
      for (double& x : corner) x = cursor_.read_real_of({NumberType::Kind::kReal, sizeof(float)}, "a coordinate");
    cursor_.read_bytes(2, "the attribute of a triangle");
    add_triangle(corners);
  }
  const std::size_t expected = kHeaderBytes + kCountBytes + count * kTriangleBytes;
  if (bytes_.size() != expected)
    cursor_.fail(fmt::format("a file of {} bytes, as its {} triangles take", expected, count),
                 std::to_string(bytes_.size()), "is the file damaged?");
}

void StlReader::read_text() {
  do read_solid();
  while (!cursor_.at_end());
}

// 'solid NAME' and its facets; the name may have blanks.
void StlReader::read_solid() {
  const std::string_view line = cursor_.read_text_line("'solid'");
  if (lower(line.substr(0, 5)) != "solid") cursor_.fail("'solid'", quote(line));
  const std::string name(trimmed(line.substr(5)));
  const std::size_t begin = triangles_.size();
  while (true) {
    const std::string_view word = cursor_.read_word();
    if (lower(word) == "endsolid") break;
    if (lower(word) != "facet") cursor_.fail("'facet' or 'endsolid'", cursor_.describe(word));
    read_facet();
  }
  if (!cursor_.at_end()) cursor_.read_text_line("the end of the line");
  cursor_.skip_blank_lines();
  parts_.add_triangles(name, begin, triangles_.size());
}

void StlReader::read_facet() {
  expect("normal");
  for (int axis = 0; axis < 3; ++axis)
    if (const auto word = cursor_.read_word(); word.empty()) cursor_.fail("a normal", cursor_.describe(word));
  expect("outer");
  expect("loop");
  std::array<Corner, 3> corners{};
  for (Corner& corner : corners) {
    expect("vertex");
    for (double& x : corner) x = cursor_.read_real("a coordinate");
  }
  expect("endloop");
  expect("endfacet");
  add_triangle(corners);
}

void StlReader::expect(std::string_view word) {
  if (const auto found = cursor_.read_word(); lower(found) != word) cursor_.fail(quote(word), cursor_.describe(found));
}

void StlReader::add_triangle(const std::array<Corner, 3>& corners) {
  auto& triangle = triangles_.emplace_back();
  for (std::size_t k = 0; k < 3; ++k) {
    Corner corner = corners[k];
    for (double& x : corner) x += 0.0;  // no negative zero
    const auto [vertex, is_new] = indices_.try_emplace(corner, static_cast<std::int32_t>(vertices_.size()));
    if (is_new) vertices_.push_back(corner);
    triangle[k] = vertex->second;
  }
}

}  // namespace

SurfaceFile read_stl(const std::filesystem::path& file) {
  const std::string bytes = read_text_file(file, "a .stl file");
  SurfaceFile surface = StlReader(file.string(), bytes).read();
  surface.files = {file};
  return surface;
}

}  // namespace exmat
