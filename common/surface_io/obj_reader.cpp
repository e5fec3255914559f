#include "common/surface_io/obj_reader.h"

#include <algorithm>
#include <array>
#include <fmt/format.h>
#include <string>

#include "common/surface_io/commented_lines.h"
#include "common/surface_io/mesh_arrays.h"
#include "common/surface_io/polygon_faces.h"
#include "common/surface_io/surface_parts.h"
#include "common/surface_io/text_input.h"

namespace exmat {
namespace {

std::vector<std::string> words(std::string_view text) {
  std::vector<std::string> found;
  for (std::size_t begin = 0; (begin = text.find_first_not_of(" \t", begin)) != std::string_view::npos;) {
    const std::size_t end = std::min(text.find_first_of(" \t", begin), text.size());
    found.emplace_back(text.substr(begin, end - begin));
    begin = end;
  }
  return found;
}

class ObjReader {
 public:
  explicit ObjReader(const std::filesystem::path& file) : lines_(file, "an .obj file") {}

  SurfaceFile read();

 private:
  // Names of a statement and the first triangle that they are of.
  struct Naming {
    std::string_view keyword;
    std::vector<std::string> names{};
    std::size_t begin = 0;
  };
  void name_part(Naming& naming, std::vector<std::string> names);
  std::string whole_statement();
  void read_statement(const FileLine& line);
  void read_vertex(const FileLine& line, Fields fields);
  void read_face(const FileLine& line, Fields fields);
  std::int32_t read_corner(const FileLine& line, std::string_view field);

  CommentedLines lines_;
  std::vector<std::array<double, 3>> vertices_;
  PolygonFaces faces_;
  // The largest index so far and its line: vertices may follow the faces.
  std::int64_t largest_ = -1;
  FileLine line_of_largest_;
  std::array<Naming, 3> namings_{{{"o"}, {"g"}, {"usemtl"}}};
  SurfaceParts parts_;
  std::size_t bytes_ = 0;  // read so far
};

SurfaceFile ObjReader::read() {
  for (; lines_.current(); lines_.advance()) {
    FileLine line = *lines_.current();
    const std::string statement = whole_statement();
    line.text = statement;
    bytes_ += statement.size() + 1;
    read_statement(line);
  }
  if (vertices_.empty()) lines_.fail("vertices ('v x y z')");
  if (faces_.triangles().empty()) lines_.fail("faces ('f 1 2 3')");
  if (largest_ >= std::ssize(vertices_))
    fail_at(line_of_largest_, fmt::format("vertices 1 to {}, which the file has", vertices_.size()),
            std::to_string(largest_ + 1));
  for (Naming& naming : namings_) name_part(naming, {});
  SurfaceFile surface;
  surface.warnings = faces_.cut_ears(vertices_, lines_.files().front());
  surface.mesh = {vertex_array(vertices_), triangle_array(faces_.triangles())};
  surface.files = lines_.files();
  parts_.finish(surface, bytes_);
  return surface;
}

// With the lines that continue it, after a backslash at the end of each.
std::string ObjReader::whole_statement() {
  std::string text(lines_.current()->text);
  while (text.ends_with('\\')) {
    text.back() = ' ';
    lines_.advance();
    if (!lines_.current()) lines_.fail("a line after one that ends with '\\'");
    text += lines_.current()->text;
  }
  return text;
}

void ObjReader::read_statement(const FileLine& line) {
  Fields fields(line.text, Fields::Separators::kBlanks);
  const std::string_view keyword = fields.next();
  if (keyword == "v") read_vertex(line, fields);
  if (keyword == "f") read_face(line, fields);
  const auto naming = std::ranges::find(namings_, keyword, &Naming::keyword);
  if (naming == namings_.end()) return;
  const std::string_view rest = trimmed(line.text.substr(keyword.size()));
  name_part(*naming, keyword == "g" ? words(rest) : std::vector{std::string(rest)});
}

void ObjReader::name_part(Naming& naming, std::vector<std::string> names) {
  for (const std::string& name : naming.names) parts_.add_triangles(name, naming.begin, faces_.triangles().size());
  naming.names = std::move(names);
  naming.begin = faces_.triangles().size();
}

// A weight or a colour may follow.
void ObjReader::read_vertex(const FileLine& line, Fields fields) {
  auto& vertex = vertices_.emplace_back();
  vertex[0] = read_real(line, fields, "an x coordinate");
  vertex[1] = read_real(line, fields, "a y coordinate");
  vertex[2] = read_real(line, fields, "a z coordinate");
}

void ObjReader::read_face(const FileLine& line, Fields fields) {
  std::vector<std::int32_t> polygon;
  for (auto field = fields.next(); !field.empty(); field = fields.next()) polygon.push_back(read_corner(line, field));
  if (polygon.size() < 3) fail_at(line, "a face of at least 3 vertices", std::to_string(polygon.size()));
  faces_.add(polygon);
}

// 'vertex', 'vertex/texture', 'vertex//normal' or 'vertex/texture/normal'.
std::int32_t ObjReader::read_corner(const FileLine& line, std::string_view field) {
  constexpr std::int64_t kMost = 2147483647;
  const auto number = parse_integer(field.substr(0, field.find('/')));
  const std::int64_t count = std::ssize(vertices_);
  const std::int64_t index = number.value_or(0) < 0 ? count + *number : number.value_or(0) - 1;
  if (!number || *number == 0 || index < 0 || index >= kMost)
    fail_at(line, "the number of a vertex, from 1, or negative, from the last one back", quote(field));
  if (index > largest_) {
    largest_ = index;
    line_of_largest_ = {{}, line.file, line.number};
  }
  return static_cast<std::int32_t>(index);
}

}  // namespace

SurfaceFile read_obj(const std::filesystem::path& file) { return ObjReader(file).read(); }

}  // namespace exmat
