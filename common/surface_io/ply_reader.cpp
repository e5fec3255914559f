#include "common/surface_io/ply_reader.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <fmt/format.h>
#include <optional>
#include <string>
#include <utility>

#include "common/core/input_file.h"
#include "common/surface_io/mesh_arrays.h"
#include "common/surface_io/polygon_faces.h"
#include "common/surface_io/text_input.h"
#include "common/surface_io/value_cursor.h"

namespace exmat {
namespace {

using Kind = NumberType::Kind;

constexpr std::array<std::pair<std::string_view, NumberType>, 16> kTypes{{{"char", {Kind::kSigned, 1}},
                                                                          {"int8", {Kind::kSigned, 1}},
                                                                          {"uchar", {Kind::kUnsigned, 1}},
                                                                          {"uint8", {Kind::kUnsigned, 1}},
                                                                          {"short", {Kind::kSigned, 2}},
                                                                          {"int16", {Kind::kSigned, 2}},
                                                                          {"ushort", {Kind::kUnsigned, 2}},
                                                                          {"uint16", {Kind::kUnsigned, 2}},
                                                                          {"int", {Kind::kSigned, 4}},
                                                                          {"int32", {Kind::kSigned, 4}},
                                                                          {"uint", {Kind::kUnsigned, 4}},
                                                                          {"uint32", {Kind::kUnsigned, 4}},
                                                                          {"float", {Kind::kReal, 4}},
                                                                          {"float32", {Kind::kReal, 4}},
                                                                          {"double", {Kind::kReal, 8}},
                                                                          {"float64", {Kind::kReal, 8}}}};

struct Property {
  std::string name;
  NumberType type;
  std::optional<NumberType> count;  // of a list
};

struct Element {
  std::string name;
  std::uint64_t count = 0;
  std::vector<Property> properties;
};

class PlyReader {
 public:
  PlyReader(const std::filesystem::path& file, std::string_view bytes)
      : file_(file), cursor_(file.string(), bytes, ValueCursor::Layout::kAnywhere) {}

  SurfaceFile read();

 private:
  void read_header();
  void read_format(Fields& fields);
  void read_property(Fields& fields);
  NumberType type(std::string_view name) const;
  void check_properties(const Element& element) const;
  void check_count(const Element& element) const;
  void read_element(const Element& element);
  double read_channel(const Property& property);
  void read_list(const Element& element, const Property& property);
  void check_faces() const;

  std::filesystem::path file_;
  ValueCursor cursor_;
  bool binary_ = false, swap_ = false;
  std::vector<Element> elements_;
  std::vector<std::array<double, 3>> vertices_;
  PolygonFaces faces_;
  std::vector<std::array<double, 3>> colours_;  // of each vertex, where all three properties are there
};

bool is_corners(const Element& element, const Property& property) {
  return element.name == "face" && (property.name == "vertex_indices" || property.name == "vertex_index");
}

constexpr std::array<std::string_view, 3> kAxes{"x", "y", "z"}, kChannels{"red", "green", "blue"};

// 3 where the name is none of them.
std::size_t index_of(const std::array<std::string_view, 3>& names, std::string_view name) {
  return static_cast<std::size_t>(std::ranges::find(names, name) - names.begin());
}

// True if it has a property that is one number.
bool has(const Element& element, std::string_view name) {
  return std::ranges::any_of(element.properties, [&](const Property& p) { return p.name == name && !p.count; });
}

SurfaceFile PlyReader::read() {
  read_header();
  for (const Element& element : elements_) check_properties(element);
  if (binary_) cursor_.set_binary(swap_);
  for (const Element& element : elements_) read_element(element);
  if (!cursor_.at_end()) {
    const auto extra = cursor_.read_word();
    cursor_.fail("the end of the file", quote(extra), "check the counts of the header");
  }
  if (vertices_.empty()) cursor_.fail("vertices", "none");
  if (faces_.triangles().empty()) {
    const bool strips = std::ranges::find(elements_, "tristrips", &Element::name) != elements_.end();
    cursor_.fail("faces of at least 3 vertices", strips ? "triangle strips (the element tristrips)" : "none",
                 strips ? "save it with faces, as MeshLab or Blender does" : "");
  }
  check_faces();
  SurfaceFile surface;
  surface.warnings = faces_.cut_ears(vertices_, file_);
  surface.mesh = {vertex_array(vertices_), triangle_array(faces_.triangles())};
  surface.colours = vertex_array(colours_);
  return surface;
}

void PlyReader::read_header() {
  if (const auto first = cursor_.read_text_line("'ply'"); first != "ply")
    cursor_.fail("'ply'", quote(first), "is this a .ply file?");
  bool has_format = false;
  while (true) {
    const std::string_view line = cursor_.read_text_line("a line of the header, at last 'end_header'");
    Fields fields(line);
    const std::string_view keyword = fields.next();
    if (keyword == "end_header") break;
    if (keyword == "comment" || keyword == "obj_info" || keyword.empty()) continue;
    if (keyword == "format") {
      read_format(fields);
      has_format = true;
    } else if (keyword == "element") {
      const std::string name(fields.next());
      const std::string_view field = fields.next();
      const auto count = parse_integer(field);
      if (!count || *count < 0) cursor_.fail(fmt::format("the number of elements '{}'", name), quote(field));
      elements_.push_back({name, static_cast<std::uint64_t>(*count), {}});
    } else if (keyword == "property") {
      read_property(fields);
    } else {
      cursor_.fail("'format', 'element', 'property', 'comment' or 'end_header'", quote(line));
    }
  }
  if (!has_format) cursor_.fail("a line 'format' in the header", "none");
}

void PlyReader::read_format(Fields& fields) {
  const std::string_view name = fields.next(), version = fields.next();
  if (name != "ascii" && name != "binary_little_endian" && name != "binary_big_endian")
    cursor_.fail("ascii, binary_little_endian or binary_big_endian", quote(name));
  if (version != "1.0") cursor_.fail("version 1.0", quote(version));
  binary_ = name != "ascii";
  swap_ = (name == "binary_little_endian") != (std::endian::native == std::endian::little);
}

void PlyReader::read_property(Fields& fields) {
  if (elements_.empty()) cursor_.fail("an element before its properties", "none");
  Property property;
  std::string_view field = fields.next();
  if (field == "list") {
    property.count = type(fields.next());
    if (property.count->kind == Kind::kReal) cursor_.fail("a count of integers", "one of reals");
    field = fields.next();
  }
  property.type = type(field);
  property.name = fields.next();
  if (property.name.empty()) cursor_.fail("the name of a property", "the end of the line");
  elements_.back().properties.push_back(std::move(property));
}

NumberType PlyReader::type(std::string_view name) const {
  for (const auto& [known, type] : kTypes)
    if (known == name) return type;
  cursor_.fail("a type of numbers, such as 'float' or 'int'", quote(name));
}

void PlyReader::check_properties(const Element& element) const {
  if (element.name == "vertex" &&
      !std::ranges::all_of(kAxes, [&](std::string_view name) { return has(element, name); }))
    cursor_.fail("properties x, y and z of the vertices", "fewer");
  if (element.name == "face" && std::ranges::none_of(element.properties, [&](const Property& p) {
        return is_corners(element, p) && p.count && p.type.kind != Kind::kReal;
      }))
    cursor_.fail("a list of integers 'vertex_indices' of the faces", "none");
}

// Each property has at least one number, or the count of a list.
void PlyReader::check_count(const Element& element) const {
  std::size_t bytes = 0;
  for (const Property& property : element.properties)
    bytes += !binary_ ? 1 : property.count ? property.count->bytes : property.type.bytes;
  if (bytes > 0) cursor_.check_count(element.count, fmt::format("elements '{}'", element.name), bytes);
}

void PlyReader::read_element(const Element& element) {
  check_count(element);
  if (element.properties.empty()) return;
  const bool is_vertex = element.name == "vertex";
  const bool coloured =
      is_vertex && std::ranges::all_of(kChannels, [&](std::string_view name) { return has(element, name); });
  for (std::uint64_t k = 0; k < element.count; ++k) {
    if (is_vertex) vertices_.emplace_back();
    if (coloured) colours_.emplace_back();
    for (const Property& property : element.properties) {
      const std::size_t axis = index_of(kAxes, property.name), channel = index_of(kChannels, property.name);
      if (property.count)
        read_list(element, property);
      else if (is_vertex && axis < 3)
        vertices_.back()[axis] = cursor_.read_real_of(property.type, fmt::format("coordinate {}", property.name));
      else if (coloured && channel < 3)
        colours_.back()[channel] = read_channel(property);
      else
        cursor_.skip_values(1, property.type, fmt::format("property '{}'", property.name));
    }
  }
}

double PlyReader::read_channel(const Property& property) {
  const double value = cursor_.read_real_of(property.type, fmt::format("colour '{}'", property.name));
  const bool is_signed = property.type.kind == Kind::kSigned;
  const double largest =
      property.type.kind == Kind::kReal ? 1 : std::exp2(8 * static_cast<int>(property.type.bytes) - is_signed) - 1;
  return std::clamp(value / largest, 0.0, 1.0);
}

void PlyReader::read_list(const Element& element, const Property& property) {
  const std::int64_t count = cursor_.read_integer_of(*property.count, "the length of a list");
  if (count < 0) cursor_.fail("the length of a list, at least 0", fmt::format("{}", count));
  if (!is_corners(element, property)) {
    cursor_.skip_values(static_cast<std::uint64_t>(count), property.type, "a value of a list");
    return;
  }
  cursor_.check_values(static_cast<std::uint64_t>(count), property.type, "vertices of a face");
  std::vector<std::int32_t> polygon;
  for (std::int64_t k = 0; k < count; ++k) {
    const std::int64_t index = cursor_.read_integer_of(property.type, "a vertex of a face");
    // If the vertices come last, check_faces knows how many there are.
    const std::int64_t end = vertices_.empty() ? 2147483647 : std::ssize(vertices_);
    if (index < 0 || index >= end)
      cursor_.fail(fmt::format("a vertex from 0 to {}", end - 1), fmt::format("{}", index));
    polygon.push_back(static_cast<std::int32_t>(index));
  }
  if (count < 3) cursor_.fail("a face of at least 3 vertices", fmt::format("{}", count));
  faces_.add(polygon);
}

void PlyReader::check_faces() const {
  for (const auto& triangle : faces_.triangles())
    for (const auto corner : triangle)
      if (corner >= std::ssize(vertices_))
        cursor_.fail(fmt::format("faces of vertices from 0 to {}", vertices_.size() - 1), fmt::format("{}", corner));
}

}  // namespace

SurfaceFile read_ply(const std::filesystem::path& file) {
  const std::string bytes = read_text_file(file, "a .ply file");
  SurfaceFile surface = PlyReader(file, bytes).read();
  surface.files = {file};
  return surface;
}

}  // namespace exmat
