#include "precompute/mesh_io/surface_file.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cctype>
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <map>
#include <random>

#include "common/mesh/geometry.h"
#include "tests/precompute/mesh_io/gltf_samples.h"
#include "tests/precompute/mesh_io/mesh_samples.h"
#include "tests/support/box_mesh.h"

namespace exmat::precompute {
namespace surface_file_test {

SurfaceMesh read_surface(const std::filesystem::path& file) { return read_surface_file(file).mesh; }

using test::ByteWriter;
using test::complaint_of;
using test::edited;
using test::TemporaryFolder;
using testing::HasSubstr;

// A surface whose coordinates take all their digits.
SurfaceMesh sample() {
  const TetMesh cube = exmat::test::cube_grid(1, 0.1);
  SurfaceMesh surface{cube.vertices, surface_triangles(cube.tets)};
  for (Eigen::Index v = 0; v < surface.vertices.rows(); ++v)
    surface.vertices.row(v) +=
        0.01 * Eigen::RowVector3d(std::sin(v), std::cos(v), std::sin(2.0 * static_cast<double>(v)));
  return surface;
}

// One that formats of single precision and of triangles without indices keep: vertices in the order of the triangles.
SurfaceMesh single_sample() {
  const SurfaceMesh all = sample();
  SurfaceMesh surface{VertexArray(all.vertices.rows(), 3), all.triangles};
  std::map<std::int32_t, std::int32_t> index;
  for (std::int32_t& corner : surface.triangles.reshaped<Eigen::RowMajor>()) {
    const auto [entry, is_new] = index.try_emplace(corner, static_cast<std::int32_t>(index.size()));
    if (is_new) surface.vertices.row(entry->second) = all.vertices.row(corner).cast<float>().cast<double>();
    corner = entry->second;
  }
  return surface;
}

bool same_surface(const SurfaceMesh& a, const SurfaceMesh& b) {
  return a.vertices.rows() == b.vertices.rows() && a.triangles.rows() == b.triangles.rows() &&
         a.vertices == b.vertices && a.triangles == b.triangles;
}

std::string to_obj(const SurfaceMesh& surface) {
  std::string text = "# sample\nmtllib none.mtl\no cube\n";
  for (const auto& x : surface.vertices.rowwise()) text += fmt::format("v {} {} {}\n", x[0], x[1], x[2]);
  text += "vt 0 0\nvn 0 0 1\ns off\n";
  for (const auto& t : surface.triangles.rowwise())
    text += fmt::format("f {}/1 {}//1 {}/1/1\n", t[0] + 1, t[1] + 1, t[2] + 1);
  return text;
}

enum class Encoding { kText, kLittle, kBig };

// With a property and an element that are not used.
std::string to_ply(const SurfaceMesh& surface, Encoding encoding) {
  const bool text = encoding == Encoding::kText;
  const bool little = encoding == Encoding::kLittle;
  ByteWriter out(!text && little != (std::endian::native == std::endian::little));
  out.text(fmt::format("ply\nformat {} 1.0\ncomment sample\n", text     ? "ascii"
                                                               : little ? "binary_little_endian"
                                                                        : "binary_big_endian"));
  out.text(
      fmt::format("element vertex {}\nproperty double x\nproperty double y\nproperty int mark\nproperty double z\n",
                  surface.vertices.rows()));
  out.text("element edge 1\nproperty int vertex1\nproperty list int double lengths\n");
  out.text(
      fmt::format("element face {}\nproperty list int int vertex_indices\nend_header\n", surface.triangles.rows()));
  const auto real = [&](double value) { text ? out.text(fmt::format("{} ", value)) : out.real(value); };
  const auto integer = [&](int value) { text ? out.text(fmt::format("{} ", value)) : out.integer(value); };
  const auto end_row = [&] { out.text(text ? "\n" : ""); };
  for (const auto& x : surface.vertices.rowwise()) {
    real(x[0]);
    real(x[1]);
    integer(7);
    real(x[2]);
    end_row();
  }
  integer(0);
  integer(2);
  real(0.5);
  real(1.5);
  end_row();
  for (const auto& triangle : surface.triangles.rowwise()) {
    integer(3);
    for (const auto corner : triangle) integer(corner);
    end_row();
  }
  return out.bytes();
}

std::string to_stl_text(const SurfaceMesh& surface) {
  std::string text = "solid sample of text\n";
  for (const auto& triangle : surface.triangles.rowwise()) {
    text += "  facet normal 0 0 1\n    outer loop\n";
    for (const auto corner : triangle)
      text += fmt::format("      vertex {} {} {}\n", surface.vertices(corner, 0), surface.vertices(corner, 1),
                          surface.vertices(corner, 2));
    text += "    endloop\n  endfacet\n";
  }
  return text + "endsolid\n";
}

std::string to_stl_binary(const SurfaceMesh& surface, const std::string& header) {
  std::string bytes = header;
  bytes.resize(80, '\0');
  bytes += test::gltf_bytes(test::kUnsignedInt, {static_cast<double>(surface.triangles.rows())});
  for (const auto& triangle : surface.triangles.rowwise()) {
    bytes += test::gltf_bytes(test::kFloat, {0, 0, 1});
    for (const auto corner : triangle)
      for (const double x : surface.vertices.row(corner)) bytes += test::gltf_bytes(test::kFloat, {x});
    bytes += std::string(2, '\0');
  }
  return bytes;
}

test::GltfWriter gltf_writer(const SurfaceMesh& surface) {
  test::GltfWriter writer;
  const auto numbers = [](const auto& array) {
    const auto values = array.template reshaped<Eigen::RowMajor>();
    return std::vector<double>(values.begin(), values.end());
  };
  const int positions = writer.positions(numbers(surface.vertices));
  const int corners = writer.accessor(test::kUnsignedByte, "SCALAR", numbers(surface.triangles));
  writer.mesh_in_node("body", {{"attributes", {{"POSITION", positions}}}, {"indices", corners}});
  return writer;
}

struct SurfaceFlavour {
  std::string name, extension;
  std::string (*write)(const SurfaceMesh&);
  SurfaceMesh (*surface)() = sample;
  std::size_t accepted =
      0;  // truncations that lose nothing: the last line of a text needs neither its blank nor its end
};

void PrintTo(const SurfaceFlavour& flavour, std::ostream* stream) { *stream << flavour.name; }

class EachSurfaceFlavour : public testing::TestWithParam<SurfaceFlavour> {
 protected:
  SurfaceMesh read(std::string_view bytes) const {
    return read_surface(folder_.write("body" + GetParam().extension, bytes));
  }

  TemporaryFolder folder_;
};

TEST_P(EachSurfaceFlavour, GivesTheSameSurface) {
  EXPECT_TRUE(same_surface(read(GetParam().write(GetParam().surface())), GetParam().surface()));
}

TEST_P(EachSurfaceFlavour, IsRefusedAtEveryTruncationOrHasFewerFaces) {
  const std::string whole = GetParam().write(GetParam().surface());
  std::size_t accepted = 0;
  for (std::size_t length = 0; length < whole.size(); ++length) try {
      const SurfaceMesh result = read(std::string_view(whole).substr(0, length));
      ++accepted;
      const VertexArray expected = GetParam().surface().vertices;
      ASSERT_EQ(result.vertices.rows(), expected.rows());
      for (const auto corner : result.triangles.reshaped())
        EXPECT_EQ(result.vertices.row(corner), expected.row(corner)) << length;
    } catch (const InputError& error) {
      EXPECT_FALSE(error.complaint().expected.empty());
    }
  // An .obj does not say how many faces it has.
  EXPECT_LE(accepted, GetParam().extension == ".obj" ? whole.size() - whole.find("f 1/1") : GetParam().accepted);
}

TEST_P(EachSurfaceFlavour, IsReadOrRefusedWithAnyByteChanged) {
  const std::string whole = GetParam().write(GetParam().surface());
  std::mt19937 random(7);
  for (int trial = 0; trial < 500; ++trial) {
    std::string bytes = whole;
    bytes[random() % bytes.size()] = trial % 2 == 0 ? static_cast<char>(random()) : "0123456789-./# \n"[random() % 16];
    try {
      const SurfaceMesh result = read(bytes);
      ASSERT_GT(result.triangles.rows(), 0);
      EXPECT_GE(result.triangles.minCoeff(), 0);
      EXPECT_LT(result.triangles.maxCoeff(), result.vertices.rows());
      EXPECT_TRUE(result.vertices.allFinite());
    } catch (const InputError& error) {
      EXPECT_FALSE(error.complaint().expected.empty());
    }
  }
}

INSTANTIATE_TEST_SUITE_P(
    Surface, EachSurfaceFlavour,
    testing::Values(
        SurfaceFlavour{"Obj", ".obj", to_obj},
        SurfaceFlavour{"PlyText", ".ply", [](const SurfaceMesh& s) { return to_ply(s, Encoding::kText); }, sample, 2},
        SurfaceFlavour{"PlyLittle", ".ply", [](const SurfaceMesh& s) { return to_ply(s, Encoding::kLittle); }},
        SurfaceFlavour{"PlyBig", ".ply", [](const SurfaceMesh& s) { return to_ply(s, Encoding::kBig); }},
        SurfaceFlavour{"StlText", ".stl", to_stl_text, single_sample, 1},
        SurfaceFlavour{"StlBinary", ".stl", [](const SurfaceMesh& s) { return to_stl_binary(s, "made by a test"); },
                       single_sample},
        SurfaceFlavour{"StlSolidBinary", ".stl", [](const SurfaceMesh& s) { return to_stl_binary(s, "solid body"); },
                       single_sample},
        SurfaceFlavour{"Glb", ".glb", [](const SurfaceMesh& s) { return gltf_writer(s).glb(); }, single_sample},
        SurfaceFlavour{"Gltf", ".gltf", [](const SurfaceMesh& s) { return gltf_writer(s).gltf(); }, single_sample}),
    [](const auto& param) { return param.param.name; });

TEST_P(EachSurfaceFlavour, IsReadInAnyLocale) {
  const test::DecimalComma comma;
  EXPECT_TRUE(same_surface(read(GetParam().write(GetParam().surface())), GetParam().surface()));
}

TEST_P(EachSurfaceFlavour, IsReadWithItsExtensionInCapitals) {
  std::string extension = GetParam().extension;
  for (char& c : extension) c = static_cast<char>(std::toupper(c));
  const auto file = folder_.write("BODY" + extension, GetParam().write(GetParam().surface()));
  EXPECT_TRUE(same_surface(read_surface(file), GetParam().surface()));
}

TEST_P(EachSurfaceFlavour, IsReadWithAByteOrderMarkAndOtherEndsOfLines) {
  std::string text = GetParam().write(GetParam().surface());
  if (text.find('\0') != std::string::npos) GTEST_SKIP() << "it is binary";
  EXPECT_TRUE(same_surface(read("\xef\xbb\xbf" + text), GetParam().surface()));
  std::ranges::replace(text, '\n', '\r');
  EXPECT_TRUE(same_surface(read(text), GetParam().surface()));
}

constexpr auto kObj = R"(# a square and a triangle
v 0 0 0
v 1 0 0 1.0
v 1 1 0 0.5 0.5 0.5
v 0 1 0
f 1 2 3 4
v 0 0 1
f -1 1 \
  -4
)";

constexpr auto kPly = R"(ply
format ascii 1.0
element vertex 4
property float x
property float y
property float z
element face 1
property list uchar int vertex_indices
end_header
0 0 0
1 0 0
1 1 0
0 1 0
4 0 1 2 3
)";

TEST(ReadSurface, NeedsNoLineEndAfterTheLastLine) {
  const TemporaryFolder folder;
  for (const auto& [name, text] : {std::pair("a.obj", kObj), std::pair("a.ply", kPly)}) {
    const SurfaceMesh expected = read_surface(folder.write(name, text));
    EXPECT_TRUE(
        same_surface(read_surface(folder.write(name, std::string(text, std::string_view(text).size() - 1))), expected));
  }
}

TEST(ReadSurface, TakesPolygonsAsFansAndIndicesFromTheEnd) {
  const TemporaryFolder folder;
  const SurfaceMesh obj = read_surface(folder.write("body.obj", kObj));
  EXPECT_EQ(obj.vertices.rows(), 5);
  ASSERT_EQ(obj.triangles.rows(), 3);
  EXPECT_EQ(obj.triangles.row(0), Eigen::RowVector3i(0, 1, 2));
  EXPECT_EQ(obj.triangles.row(1), Eigen::RowVector3i(0, 2, 3));
  EXPECT_EQ(obj.triangles.row(2), Eigen::RowVector3i(4, 0, 1));
  const SurfaceMesh ply = read_surface(folder.write("body.ply", kPly));
  EXPECT_EQ(ply.triangles, obj.triangles.topRows(2));
  EXPECT_EQ(ply.vertices, obj.vertices.topRows(4));
}

TEST(ReadSurface, NamesPartsOfAnObjAndItsFile) {
  const TemporaryFolder folder;
  const auto file = folder.write("body.obj",
                                 "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 9 9 9\no my body\ng left all\nusemtl skin\n"
                                 "f 1 2 3\ng right all\nf 1 3 4\nusemtl cloth\nf 1 2 4\nusemtl empty\n");
  const SurfaceFile surface = read_surface_file(file);
  EXPECT_THAT(surface.files, testing::ElementsAre(file));
  const auto flags = [](std::array<std::uint8_t, 5> values) {
    return FlagVector(Eigen::Map<FlagVector>(values.data(), 5));
  };
  const std::map<std::string, FlagVector> expected{
      {"my body", flags({1, 1, 1, 1, 0})}, {"all", flags({1, 1, 1, 1, 0})},  {"left", flags({1, 1, 1, 0, 0})},
      {"right", flags({1, 1, 1, 1, 0})},   {"skin", flags({1, 1, 1, 1, 0})}, {"cloth", flags({1, 1, 0, 1, 0})}};
  EXPECT_EQ(surface.parts, expected);
}

TEST(ReadSurface, KeepsNoPartsOutOfProportionToTheFile) {
  const TemporaryFolder folder;
  std::string text;
  for (int v = 0; v < 20'000; ++v) text += "v 0 0 0\n";
  for (int name = 0; name < 20'000; ++name) text += fmt::format("g {}\nf 1 2 3\n", name);
  const SurfaceFile surface = read_surface_file(folder.write("body.obj", text));
  EXPECT_TRUE(surface.parts.empty());
  EXPECT_THAT(surface.remarks, testing::ElementsAre(HasSubstr("20000 names of parts are too many"),
                                                    HasSubstr("19997 vertices of no triangle")));
}

TEST(ReadSurface, TakesColoursOfAPly) {
  const TemporaryFolder folder;
  const auto colours = [&](const std::string& type, const std::string& rows) {
    std::string text =
        "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n";
    for (const char* name : {"red", "green", "blue", "alpha"}) text += "property " + type + " " + name + "\n";
    text += "element face 1\nproperty list uchar int vertex_indices\nend_header\n" + rows + "3 0 1 2\n";
    return read_surface_file(folder.write("body.ply", text)).colours;
  };
  EXPECT_EQ(colours("uchar", "0 0 0 255 0 51 9\n1 0 0 0 102 0 9\n0 1 0 0 0 0 9\n"),
            (VertexArray(3, 3) << 1, 0, 0.2, 0, 0.4, 0, 0, 0, 0).finished());
  EXPECT_EQ(colours("float", "0 0 0 0.25 -1 2 9\n1 0 0 0 0 0 9\n0 1 0 0 0 1 9\n"),
            (VertexArray(3, 3) << 0.25, 0, 1, 0, 0, 0, 0, 0, 1).finished());
  EXPECT_EQ(read_surface_file(folder.write("plain.ply", kPly)).colours.rows(), 0);
}

struct Malformed {
  const char *name, *extension, *from, *to, *place, *expected, *found;
};

void PrintTo(const Malformed& malformed, std::ostream* stream) { *stream << malformed.name; }

class RefusesSurface : public testing::TestWithParam<Malformed> {};

TEST_P(RefusesSurface, WithPlaceExpectedAndFound) {
  const TemporaryFolder folder;
  const bool is_obj = std::string(GetParam().extension) == ".obj";
  const auto file = folder.write(std::string("bad") + GetParam().extension,
                                 edited(is_obj ? kObj : kPly, GetParam().from, GetParam().to));
  const Complaint complaint = complaint_of([&] { read_surface(file); });
  EXPECT_EQ(complaint.file, file.string());
  EXPECT_EQ(complaint.place, GetParam().place);
  EXPECT_THAT(complaint.expected, HasSubstr(GetParam().expected));
  EXPECT_THAT(complaint.found, HasSubstr(GetParam().found));
}

constexpr std::array kMalformed{
    Malformed{"ObjNanCoordinate", ".obj", "v 0 1 0", "v 0 nan 0", "line 5", "a y coordinate, a finite number", "'nan'"},
    Malformed{"ObjMissingCoordinate", ".obj", "v 0 1 0", "v 0 1", "line 5", "a z coordinate", "the end of the line"},
    Malformed{"ObjFaceOfTwo", ".obj", "f 1 2 3 4", "f 1 2", "line 6", "a face of at least 3 vertices", "2"},
    Malformed{"ObjVertexZero", ".obj", "f 1 2 3 4", "f 0 2 3 4", "line 6", "the number of a vertex", "'0'"},
    Malformed{"ObjVertexAbove", ".obj", "f 1 2 3 4", "f 1 2 3 6", "line 6", "vertices 1 to 5", "6"},
    Malformed{"ObjVertexBeforeTheFirst", ".obj", "f 1 2 3 4", "f 1 2 3 -5", "line 6", "the number of a vertex", "'-5'"},
    Malformed{"ObjVertexOutOfRange", ".obj", "f 1 2 3 4", "f 1 2 3 99999999999999999999", "line 6",
              "the number of a vertex", "'99999999999999999999'"},
    Malformed{"ObjNotANumber", ".obj", "f 1 2 3 4", "f 1 2 three", "line 6", "the number of a vertex", "'three'"},
    Malformed{"ObjNoFaces", ".obj", "f 1 2 3 4\nv 0 0 1\nf -1 1 \\\n  -4\n", "", "line 5", "faces ('f 1 2 3')",
              "the end of the file"},
    Malformed{"ObjEndsInAStatement", ".obj", "\\\n  -4\n", "-4 \\\n", "line 8", "a line after one that ends with '\\'",
              "the end of the file"},
    Malformed{"PlyNotAPly", ".ply", "ply\n", "stone\n", "line 1", "'ply'", "'stone'"},
    Malformed{"PlyUnknownFormat", ".ply", "ascii", "text", "line 2", "ascii, binary_little_endian", "'text'"},
    Malformed{"PlyOtherVersion", ".ply", "ascii 1.0", "ascii 2.0", "line 2", "version 1.0", "'2.0'"},
    Malformed{"PlyNoFormat", ".ply", "format ascii 1.0\n", "", "line 8", "a line 'format'", "none"},
    Malformed{"PlyUnknownStatement", ".ply", "element face 1", "elements face 1", "line 7", "'element'",
              "'elements face 1'"},
    Malformed{"PlyUnknownType", ".ply", "float y", "real y", "line 5", "a type of numbers", "'real'"},
    Malformed{"PlyCountOfReals", ".ply", "list uchar int", "list float int", "line 8", "a count of integers",
              "one of reals"},
    Malformed{"PlyPropertyFirst", ".ply", "element vertex 4\n", "", "line 3", "an element before its properties",
              "none"},
    Malformed{"PlyNoZ", ".ply", "property float z\n", "", "line 8", "properties x, y and z", "fewer"},
    Malformed{"PlyNoCorners", ".ply", "vertex_indices", "corners", "line 9", "'vertex_indices' of the faces", "none"},
    Malformed{"PlyNegativeCount", ".ply", "face 1", "face -1", "line 7", "the number of elements 'face'", "'-1'"},
    Malformed{"PlyCountBeyondTheFile", ".ply", "vertex 4", "vertex 400", "line 9",
              "which the rest of the file can hold", "400"},
    Malformed{"PlyTooManyRows", ".ply", "face 1", "face 0", "line 14", "the end of the file", "'4'"},
    Malformed{"PlyTooFewRows", ".ply", "face 1", "face 2", "line 15", "the length of a list", "the end of the file"},
    Malformed{"PlyNanCoordinate", ".ply", "0 1 0\n", "0 nan 0\n", "line 13", "coordinate y, a finite number", "'nan'"},
    Malformed{"PlyVertexAbove", ".ply", "4 0 1 2 3", "4 0 1 2 4", "line 14", "a vertex from 0 to 3", "4"},
    Malformed{"PlyVertexBelow", ".ply", "4 0 1 2 3", "4 0 1 2 -1", "line 14", "a vertex from 0 to 3", "-1"},
    Malformed{"PlyFaceOfTwo", ".ply", "4 0 1 2 3", "2 0 1", "line 14", "a face of at least 3 vertices", "2"},
    Malformed{"PlyNegativeLength", ".ply", "4 0 1 2 3", "-4 0 1 2 3", "line 14", "the length of a list", "-4"},
    Malformed{"PlyHugeLength", ".ply", "4 0 1 2 3", "2000000000 0 1 2 3", "line 14",
              "which the rest of the file can hold", "2000000000"},
};

INSTANTIATE_TEST_SUITE_P(Malformed, RefusesSurface, testing::ValuesIn(kMalformed),
                         [](const auto& param) { return std::string(param.param.name); });

TEST(ReadSurface, VerticesOfNoTriangleAreOfNoSize) {
  const TemporaryFolder folder;
  const SurfaceFile surface =
      read_surface_file(folder.write("a.obj", "v 99 99 99\nv 0 0 0\nv 1 0 0\nv 0 2 0\nv 0 0 -50\nf 2 3 4\n"));
  EXPECT_EQ(surface.mesh.vertices.rows(), 5);
  EXPECT_EQ((surface.mesh.vertices.colwise().maxCoeff() - surface.mesh.vertices.colwise().minCoeff()).eval(),
            Eigen::RowVector3d(1, 2, 0));
  EXPECT_EQ(surface.mesh.triangles.row(0), Eigen::RowVector3i(1, 2, 3));
  EXPECT_THAT(surface.remarks, testing::ElementsAre("2 vertices of no triangle are left out of account"));
}

// As three numbers "0,5 0,5 0,5" would be (0, 5, 0).
TEST(ReadSurface, RefusesDecimalCommas) {
  const TemporaryFolder folder;
  for (const auto& [name, text] : {std::pair("a.obj", edited(kObj, "v 0 1 0", "v 0,5 1,5 0,5")),
                                   std::pair("a.ply", edited(kPly, "0 1 0\n", "0,5 1,5 0,5\n"))}) {
    const Complaint complaint = complaint_of([&, name = name, text = text] { read_surface(folder.write(name, text)); });
    EXPECT_EQ(complaint.found, "'0,5'") << name;
    EXPECT_EQ(complaint.advice, "write numbers with decimal points");
  }
}

TEST(ReadSurface, NamesTriangleStripsOfPly) {
  const TemporaryFolder folder;
  const auto file = folder.write("a.ply",
                                 "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
                                 "property float z\nelement tristrips 1\nproperty list int int vertex_indices\n"
                                 "end_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n");
  const Complaint complaint = complaint_of([&] { read_surface(file); });
  EXPECT_THAT(complaint.found, HasSubstr("triangle strips"));
  EXPECT_THAT(complaint.advice, HasSubstr("save it with faces"));
}

TEST(ReadSurface, NamesTheKnownExtensions) {
  const Complaint complaint = complaint_of([] { read_surface("body.fbx"); });
  EXPECT_THAT(complaint.expected, HasSubstr(".glb, .gltf, .obj, .ply or .stl"));
  EXPECT_EQ(complaint.found, "'.fbx'");
}

}  // namespace surface_file_test
}  // namespace exmat::precompute
