#include "precompute/mesh_io/mesh_file.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <fmt/format.h>
#include <fstream>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <random>

#include "common/mesh/checks.h"
#include "precompute/mesh_io/surface_file.h"
#include "tests/precompute/mesh_io/mesh_samples.h"

namespace exmat::precompute {
namespace {

using test::complaint_of;
using test::TemporaryFolder;
using testing::HasSubstr;

Complaint complaint_of_reading(const std::filesystem::path& file) {
  return complaint_of([&] { read_mesh(file); });
}

TEST(ReadMesh, NamesTheKnownExtensions) {
  const Complaint complaint = complaint_of_reading("body.stl");
  EXPECT_EQ(complaint.file, "body.stl");
  EXPECT_THAT(complaint.expected, HasSubstr(".mesh or .vtk"));
  EXPECT_EQ(complaint.found, "'.stl'");
  EXPECT_THAT(complaint.advice, HasSubstr("it is a surface: name it by \"surface\""));
  EXPECT_EQ(complaint_of_reading("body").found, "no extension");
}

TEST(ReadMesh, RefusesAMissingFileAndAFolder) {
  const TemporaryFolder folder;
  EXPECT_EQ(complaint_of_reading(folder.path("none.veg")).found, "no such file");
  EXPECT_EQ(complaint_of_reading(folder.path("none.msh")).found, "no such file");
  std::filesystem::create_directory(folder.path("folder.veg"));
  EXPECT_EQ(complaint_of_reading(folder.path("folder.veg")).found, "a folder");
}

TEST(ReadMesh, SaysWhatAFileOfAnotherKindIs) {
  const TemporaryFolder folder;
  const auto vtk = folder.write("body.msh", "# vtk DataFile Version 3.0\nt\nASCII\n");
  const Complaint complaint = complaint_of_reading(vtk);
  EXPECT_EQ(complaint.expected, "a .msh file");
  EXPECT_EQ(complaint.found, "a VTK file");
  EXPECT_EQ(complaint.advice, "name it with the extension .vtk");
  EXPECT_EQ(complaint_of_reading(folder.write("body.vtk", "$MeshFormat\n")).found, "a Gmsh mesh");
  EXPECT_THAT(complaint_of_reading(folder.write("a.veg", "\x89HDF\r\n")).advice, HasSubstr("is no mesh"));
  EXPECT_EQ(complaint_of([&] { read_surface_file(folder.write("a.obj", "solid a\n")); }).found, "an STL surface");
  EXPECT_EQ(complaint_of_reading(folder.write("a.exmat", "exmatpk\n")).found, "'.exmat'");
}

TEST(ReadMesh, RefusesAnEmptyFile) {
  const TemporaryFolder folder;
  const auto file = folder.write("empty.msh", "");
  const Complaint complaint = complaint_of_reading(file);
  EXPECT_EQ(complaint.file, file.string());
  EXPECT_EQ(complaint.found, "an empty file");
}

TEST(ReadMesh, RefusesAFileThatCannotBeOpened) {
  const TemporaryFolder folder;
  const auto file = folder.write("closed.veg", "*VERTICES\n");
  std::filesystem::permissions(file, std::filesystem::perms::none);
  if (std::ifstream(file)) GTEST_SKIP() << "this user may read any file";
  EXPECT_THAT(complaint_of_reading(file).found, HasSubstr("cannot be opened"));
}

class EachFlavour : public testing::TestWithParam<test::Flavour> {
 protected:
  std::filesystem::path write(std::string_view bytes) const {
    return folder_.write("mesh" + GetParam().extension, bytes);
  }

  TemporaryFolder folder_;
};

TEST_P(EachFlavour, GivesTheSameMeshAndSets) {
  const MeshFile sample = test::sample_mesh(3);
  const auto file = write(GetParam().write(sample));
  const MeshFile result = read_mesh(file);
  EXPECT_TRUE(test::same_mesh(result.mesh, sample.mesh));
  EXPECT_EQ(result.tet_sets, GetParam().sets(sample));
  EXPECT_THAT(result.files, testing::ElementsAre(file));
  MeshFile checked = result;
  EXPECT_NO_THROW(check_mesh(checked.mesh, file.string(), {}));
}

TEST_P(EachFlavour, IsReadInAnyLocale) {
  const MeshFile sample = test::sample_mesh(1);
  const auto file = write(GetParam().write(sample));
  const test::DecimalComma comma;
  const MeshFile result = read_mesh(file);
  EXPECT_TRUE(test::same_mesh(result.mesh, sample.mesh));
}

TEST_P(EachFlavour, IsReadWithItsExtensionInCapitals) {
  const MeshFile sample = test::sample_mesh(1);
  std::string extension = GetParam().extension;
  for (char& c : extension) c = static_cast<char>(std::toupper(c));
  EXPECT_TRUE(
      test::same_mesh(read_mesh(folder_.write("MESH" + extension, GetParam().write(sample))).mesh, sample.mesh));
}

TEST_P(EachFlavour, IsReadWithAByteOrderMarkAndOtherEndsOfLines) {
  const MeshFile sample = test::sample_mesh(1);
  std::string text = GetParam().write(sample);
  if (text.find('\0') != std::string::npos) GTEST_SKIP() << "it is binary";
  EXPECT_TRUE(test::same_mesh(read_mesh(write("\xef\xbb\xbf" + text)).mesh, sample.mesh));
  std::ranges::replace(text, '\n', '\r');
  EXPECT_TRUE(test::same_mesh(read_mesh(write(text)).mesh, sample.mesh));
}

TEST_P(EachFlavour, IsRefusedAtEveryTruncation) {
  const MeshFile sample = test::sample_mesh(1);
  const std::string whole = GetParam().write(sample);
  std::size_t accepted = 0;
  for (std::size_t length = 0; length < whole.size(); ++length) {
    const auto file = write(std::string_view(whole).substr(0, length));
    try {
      const MeshFile result = read_mesh(file);
      ++accepted;
      EXPECT_TRUE(test::same_mesh(result.mesh, sample.mesh)) << "cut to " << length << " bytes";
    } catch (const InputError& error) {
      EXPECT_EQ(error.complaint().file, file.string());
      EXPECT_FALSE(error.complaint().expected.empty());
    }
  }
  // A .msh or a .mesh without its last line end is whole; a .veg may end after any section that follows the tets, a
  // .vtk before and after each of its data, with and without a line end, and after the lines that begin them. As text
  // also after any digit of the last number of its data.
  constexpr std::size_t kDigits = 24;
  const std::size_t in_number = whole.find("ASCII") != std::string::npos ? kDigits : 0;
  const std::map<std::string, std::size_t> optional{
      {".msh", 1}, {".mesh", 1}, {".veg", whole.size() - whole.find("*SET") + 2}, {".vtk", 7 + in_number}};
  const std::size_t optional_bytes = optional.at(GetParam().extension);
  EXPECT_LE(accepted, optional_bytes);
  EXPECT_GE(accepted, 1U);
}

TEST_P(EachFlavour, IsReadOrRefusedWithAnyByteChanged) {
  const MeshFile sample = test::sample_mesh(1);
  const std::string whole = GetParam().write(sample);
  std::mt19937 random(7);
  for (int trial = 0; trial < 1000; ++trial) {
    std::string bytes = whole;
    for (int change = 0; change < 1 + trial % 3; ++change)
      bytes[random() % bytes.size()] =
          trial % 2 == 0 ? static_cast<char>(random()) : "0123456789-.$*\n "[random() % 16];
    const auto file = write(bytes);
    try {
      MeshFile result = read_mesh(file);
      check_mesh(result.mesh, file.string(), {true, true, true});
    } catch (const InputError& error) {
      EXPECT_EQ(error.complaint().file.find(file.parent_path().string()), 0U);
    }
  }
}

TEST_P(EachFlavour, RefusesBytesAfterTheEnd) {
  const auto file = write(GetParam().write(test::sample_mesh(1)) + "stray 1 2 3\n");
  const Complaint complaint = complaint_of_reading(file);
  EXPECT_THAT(complaint.found, HasSubstr("'stray"));
  EXPECT_FALSE(complaint.place.empty());
}

INSTANTIATE_TEST_SUITE_P(Mesh, EachFlavour, testing::ValuesIn(test::flavours()),
                         [](const auto& param) { return param.param.name; });

// A cube as one hexahedron, in each format that has such cells.
TEST(ReadMesh, NamesTheCellsOfAMeshWithoutTets) {
  const TemporaryFolder folder;
  constexpr std::array<std::array<int, 3>, 8> kCube{
      {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}, {0, 0, 1}, {1, 0, 1}, {1, 1, 1}, {0, 1, 1}}};
  std::string msh, vtk, medit;
  for (std::size_t k = 0; k < kCube.size(); ++k) {
    const std::string place = fmt::format("{} {} {}", kCube[k][0], kCube[k][1], kCube[k][2]);
    msh += fmt::format("{} {}\n", k + 1, place);
    vtk += place + "\n";
    medit += place + " 0\n";
  }
  const auto found_in = [&](const char* name, const std::string& text) {
    return complaint_of_reading(folder.write(name, text)).found;
  };
  EXPECT_EQ(found_in("a.msh", "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n8\n" + msh +
                                  "$EndNodes\n$Elements\n2\n1 5 0 1 2 3 4 5 6 7 8\n2 6 0 1 2 3 4 5 6\n$EndElements\n"),
            "1 hexahedra (element type 5), 1 prisms (element type 6)");
  EXPECT_EQ(found_in("a.vtk", "# vtk DataFile Version 3.0\ncube\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 8 double\n" +
                                  vtk + "CELLS 2 15\n8 0 1 2 3 4 5 6 7\n5 0 1 2 3 4\nCELL_TYPES 2\n12 14\n"),
            "1 hexahedra (cell type 12), 1 pyramids (cell type 14)");
  EXPECT_EQ(found_in("a.mesh", "MeshVersionFormatted 1\nDimension 3\nVertices\n8\n" + medit +
                                   "Hexahedra\n1\n1 2 3 4 5 6 7 8 0\nEnd\n"),
            "1 Hexahedra");
}

TEST(ReadMesh, TellsHowToConvertTheFirstFormatOfGmsh) {
  const TemporaryFolder folder;
  const Complaint complaint =
      complaint_of_reading(folder.write("a.msh", "$NOD\n1\n1 0 0 0\n$ENDNOD\n$ELM\n0\n$ENDELM\n"));
  EXPECT_EQ(complaint.found, "version 1");
  EXPECT_THAT(complaint.advice, HasSubstr("-format msh41"));
}

TEST(ReadMesh, TakesWindowsLineEnds) {
  const TemporaryFolder folder;
  const MeshFile sample = test::sample_mesh(1);
  for (const auto& flavour : test::flavours()) {
    std::string text = flavour.write(sample);
    const bool is_binary = text.find('\0') != std::string::npos;
    if (is_binary) continue;
    for (std::size_t i = text.find('\n'); i != std::string::npos; i = text.find('\n', i + 2)) text.insert(i, "\r");
    const MeshFile result = read_mesh(folder.write(flavour.name + flavour.extension, text));
    EXPECT_TRUE(test::same_mesh(result.mesh, sample.mesh));
    EXPECT_EQ(result.tet_sets, flavour.sets(sample));
  }
}

}  // namespace
}  // namespace exmat::precompute
