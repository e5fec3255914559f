#include "precompute/mesh_io/veg_reader.h"

#include <array>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "common/core/log.h"
#include "tests/precompute/mesh_io/mesh_samples.h"

namespace exmat::precompute {
namespace veg_reader_test {

using test::complaint_of;
using test::edited;
using test::TemporaryFolder;
using testing::ElementsAre;
using testing::HasSubstr;

constexpr auto kVertices = "*VERTICES\n5 3 0 0\n1 0 0 0\n2 1 0 0\n3 0 1 0\n4 0 0 1\n5 1 1 1\n";
constexpr auto kElements = "*ELEMENTS\nTET\n2 4 0\n1 1 2 3 4\n2 2 3 4 5\n";

std::string two_tets() { return std::string(kVertices) + kElements; }

class ReadVeg : public testing::Test {
 protected:
  MeshFile read(const std::string& text) const { return read_veg(folder_.write("mesh.veg", text)); }
  void expect_two_tets(const MeshFile& mesh_file) const {
    const MeshFile plain = read_veg(folder_.write("plain.veg", two_tets()));
    EXPECT_TRUE(test::same_mesh(mesh_file.mesh, plain.mesh));
  }

  TemporaryFolder folder_;
};

TEST_F(ReadVeg, GivesVerticesAndTets) {
  const MeshFile result = read(two_tets());
  ASSERT_EQ(result.mesh.vertex_count(), 5);
  EXPECT_EQ(result.mesh.vertices.row(3), Eigen::RowVector3d(0, 0, 1));
  ASSERT_EQ(result.mesh.tet_count(), 2);
  EXPECT_EQ(result.mesh.tets.row(1), Eigen::RowVector4i(1, 2, 3, 4));
  EXPECT_FALSE(result.materials);
  EXPECT_TRUE(result.tet_sets.empty());
}

TEST_F(ReadVeg, TakesIdsFromZero) {
  const MeshFile result = read(
      "*VERTICES\n5 3 0 0\n0 0 0 0\n1 1 0 0\n2 0 1 0\n3 0 0 1\n4 1 1 1\n"
      "*ELEMENTS\nTET\n2 4 0\n0 0 1 2 3\n1 1 2 3 4\n*SET last\n1\n");
  expect_two_tets(result);
  EXPECT_THAT(result.tet_sets.at("last"), ElementsAre(1));
}

TEST_F(ReadVeg, TakesEachWayToNameTets) {
  for (const auto heading : {"*TETS\n", "*ELEMENTS TET\n", "*ELEMENTS\nTETS\n", "*ELEMENTS\nTETRAHEDRA\n"})
    expect_two_tets(read(edited(two_tets(), "*ELEMENTS\nTET\n", heading)));
}

TEST_F(ReadVeg, RefusesDecimalCommas) {
  for (const auto& text :
       {edited(two_tets(), "\n5 1 1 1", "\n5 1 0,5 1"), edited(two_tets(), "\n5 1 1 1", "\n5 1 1 0,5"),
        two_tets() + "*MATERIAL soft\nENU, 1000, 1e5, 0,5\n"}) {
    const Complaint complaint = complaint_of([&] { read(text); });
    EXPECT_EQ(complaint.found, "'0,5'");
    EXPECT_EQ(complaint.advice, "write numbers with decimal points");
  }
  for (const char* row : {"5, 1, 1, 1, 7", "5,1,1,1,7"})
    EXPECT_EQ(complaint_of([&] { read(edited(two_tets(), "5 1 1 1", row)); }).expected, "the end of the line");
}

TEST_F(ReadVeg, TakesCommasCommentsAndBlankLines) {
  expect_two_tets(
      read("# a comment\n\n  *VERTICES  # here\n5, 3, 0, 0\n1, 0, 0.0, 0e0\n\t2,+1,-0,0 # two\n3 0 1e0 0\n\n4 0 0 1.\n"
           "5 1 1 1\n *ELEMENTS\n TET\n2,4,0\n1,1,2,3,4\n2 , 2 , 3 , 4 , 5"));
}

TEST_F(ReadVeg, SkipsTheColumnsThatItsHeadersDeclare) {
  expect_two_tets(
      read("*VERTICES\n5 3 1 1\n1 0 0 0 9 1\n2 1 0 0 9 1\n3 0 1 0 9 1\n4 0 0 1 9 0\n5 1 1 1 9 0\n"
           "*ELEMENTS\nTET\n2 4 1\n1 1 2 3 4 -7\n2 2 3 4 5 -7\n"));
}

TEST_F(ReadVeg, AssignsMaterialsByRegionsOfWhichTheLastOneCounts) {
  const MeshFile result =
      read(two_tets() +
           "*MATERIAL SOFT\nENU, 1000, 6.0e6, 0.4\n*MATERIAL HARD STEEL\nENU 7800 2e11 0.3\n*SET last one\n2, \n"
           "*REGION\nallElements, SOFT\n*REGION\nlast one, HARD STEEL\n");
  ASSERT_TRUE(result.materials);
  EXPECT_EQ(result.materials->density, Eigen::Vector2d(1000, 7800));
  EXPECT_EQ(result.materials->youngs_modulus, Eigen::Vector2d(6e6, 2e11));
  EXPECT_EQ(result.materials->poisson_ratio, Eigen::Vector2d(0.4, 0.3));
  EXPECT_THAT(result.tet_sets, ElementsAre(testing::Pair("last one", ElementsAre(1))));
}

TEST_F(ReadVeg, TakesMaterialsBeforeTheMeshAndRegionsWithoutComma) {
  const MeshFile result = read("*MATERIAL SOFT\nENU, 1000, 6.0e6, 0.4\n*REGION\nallElements SOFT\n" + two_tets());
  ASSERT_TRUE(result.materials);
  EXPECT_EQ(result.materials->density, Eigen::Vector2d(1000, 1000));
}

TEST_F(ReadVeg, LeavesMaterialsOutAndWarnsWhereATetHasNone) {
  std::vector<std::string> warnings;
  log::set_sink([&](log::Level, std::string_view message) { warnings.emplace_back(message); });
  const MeshFile result =
      read(two_tets() + "*MATERIAL SOFT\nENU, 1000, 6.0e6, 0.4\n*SET first\n1\n*REGION\nfirst, SOFT\n");
  log::set_sink({});
  EXPECT_FALSE(result.materials);
  EXPECT_THAT(warnings, ElementsAre(HasSubstr("1 of 2 tets are in no *REGION")));
}

TEST_F(ReadVeg, ReadsSetsOverLinesSortedAndWithoutRepeats) {
  EXPECT_THAT(read(two_tets() + "*SET all\n2,\n1, 2,\n1\n").tet_sets.at("all"), ElementsAre(0, 1));
}

TEST_F(ReadVeg, IncludesFilesBesideTheOneThatNamesThem) {
  const auto vertices = folder_.write("parts/vertices.node", "5 3 0 0\n1 0 0 0\n2 1 0 0\n3 0 1 0\n4 0 0 1\n5 1 1 1\n");
  const auto materials = folder_.write("parts/materials.txt", "*INCLUDE soft.txt\n*REGION\nallElements, SOFT\n");
  const auto soft = folder_.write("parts/soft.txt", "*MATERIAL SOFT\nENU, 1000, 6.0e6, 0.4");
  const MeshFile result = read("*VERTICES\n*INCLUDE parts/vertices.node\n" + std::string(kElements) +
                               "*INCLUDE parts/materials.txt # the last line");
  expect_two_tets(result);
  EXPECT_TRUE(result.materials);
  EXPECT_THAT(result.files, ElementsAre(folder_.path("mesh.veg"), vertices, materials, soft));
}

TEST_F(ReadVeg, NamesTheIncludedFileInComplaints) {
  const auto included = folder_.write("material.txt", "\n*MATERIAL SOFT\nENU, 1000, soft, 0.4\n");
  const Complaint complaint = complaint_of([&] { read(two_tets() + "*INCLUDE material.txt\n"); });
  EXPECT_EQ(complaint.file, included.string());
  EXPECT_EQ(complaint.place, "line 3");
  EXPECT_EQ(complaint.found, "'soft'");
}

TEST_F(ReadVeg, RefusesFilesThatIncludeThemselves) {
  const Complaint direct = complaint_of([&] { read(two_tets() + "*INCLUDE mesh.veg\n"); });
  EXPECT_EQ(direct.place, "line 13");
  EXPECT_THAT(direct.found, HasSubstr("includes itself"));
  folder_.write("a.txt", "*INCLUDE b.txt\n");
  const auto b = folder_.write("b.txt", "# b\n*INCLUDE ./a.txt\n");
  const Complaint mutual = complaint_of([&] { read("*INCLUDE a.txt\n"); });
  EXPECT_EQ(mutual.file, b.string());
  EXPECT_EQ(mutual.place, "line 2");
}

TEST_F(ReadVeg, RefusesAFanOfIncludes) {
  for (int level = 0; level < 20; ++level) {
    const std::string next = "*INCLUDE f" + std::to_string(level + 1) + ".txt\n";
    folder_.write("f" + std::to_string(level) + ".txt", next + next);
  }
  folder_.write("f20.txt", "# leaf\n");
  EXPECT_EQ(complaint_of([&] { read("*INCLUDE f0.txt\n"); }).expected, "at most 99 files included");
}

struct MalformedVeg {
  const char *name, *from, *to, *place, *expected, *found;
};

void PrintTo(const MalformedVeg& malformed, std::ostream* stream) { *stream << malformed.name; }

class RefusesVeg : public testing::TestWithParam<MalformedVeg> {};

constexpr auto kSound = R"(*VERTICES
5 3 0 0
1 0 0 0
2 1 0 0
3 0 1 0
4 0 0 1
5 1 1 1
*ELEMENTS
TET
2 4 0
1 1 2 3 4
2 2 3 4 5
*MATERIAL SOFT
ENU, 1000, 6.0e6, 0.4
*SET first
1
*REGION
first, SOFT
)";

TEST_P(RefusesVeg, WithPlaceExpectedAndFound) {
  const TemporaryFolder folder;
  const auto file = folder.write("bad.veg", edited(kSound, GetParam().from, GetParam().to));
  const Complaint complaint = complaint_of([&] { read_veg(file); });
  EXPECT_EQ(complaint.file, file.string());
  EXPECT_EQ(complaint.place, GetParam().place);
  EXPECT_THAT(complaint.expected, HasSubstr(GetParam().expected));
  EXPECT_THAT(complaint.found, HasSubstr(GetParam().found));
}

constexpr std::array kMalformed{
    MalformedVeg{"NotAVeg", kSound, "solid cube\n", "line 1", "*VERTICES, *ELEMENTS", "'solid cube'"},
    MalformedVeg{"UnknownKeyword", "*SET first", "*SETS first", "line 15", "*SET, *REGION", "'*SETS first'"},
    MalformedVeg{"OnlyComments", kSound, "# nothing\n\n", "line 2", "a *VERTICES section", "the end of the file"},
    MalformedVeg{"NoElements", kSound, "*VERTICES\n1 3 0 0\n1 0 0 0\n", "line 3", "an *ELEMENTS section",
                 "the end of the file"},
    MalformedVeg{"ElementsFirst", "*VERTICES\n5", "*ELEMENTS\n5", "line 1", "*VERTICES before", "'*ELEMENTS'"},
    MalformedVeg{"NegativeVertexCount", "5 3 0 0", "-5 3 0 0", "line 2", "the number of vertices", "'-5 3 0 0'"},
    MalformedVeg{"ZeroVertexCount", "5 3 0 0", "0 3 0 0", "line 2", "the number of vertices", "'0 3 0 0'"},
    MalformedVeg{"HugeVertexCount", "5 3 0 0", "4000000000 3 0 0", "line 2", "1 to 2147483647", "'4000000000 3"},
    MalformedVeg{"VertexCountBeyondTheFile", "5 3 0 0", "2000000000 3 0 0", "line 8",
                 "vertex 6, number 6 of 2000000000", "'*ELEMENTS'"},
    MalformedVeg{"VertexCountNotANumber", "5 3 0 0", "five 3 0 0", "line 2", "the number of vertices", "'five"},
    MalformedVeg{"TwoDimensions", "5 3 0 0", "5 2 0 0", "line 2", "then 3", "'5 2 0 0'"},
    MalformedVeg{"TooFewVertices", "4 0 0 1\n", "", "line 6", "vertex 4, number 4 of 5", "'5'"},
    MalformedVeg{"TooManyVertices", "5 3 0 0", "4 3 0 0", "line 7", "*ELEMENTS", "'5 1 1 1'"},
    MalformedVeg{"MissingLastVertex", "5 1 1 1\n", "", "line 7", "vertex 5, number 5 of 5", "'*ELEMENTS'"},
    MalformedVeg{"DuplicateVertexId", "3 0 1 0", "2 0 1 0", "line 5", "vertex 3", "'2'"},
    MalformedVeg{"VertexIdsFromTwo", "1 0 0 0", "2 0 0 0", "line 3", "vertex 0 or 1", "'2'"},
    MalformedVeg{"MissingCoordinate", "3 0 1 0", "3 0 1", "line 5", "a z coordinate", "the end of the line"},
    MalformedVeg{"ExtraCoordinate", "3 0 1 0", "3 0 1 0 7", "line 5", "the end of the line", "'7'"},
    MalformedVeg{"MissingDeclaredColumns", "5 3 0 0", "5 3 1 1", "line 3", "2 further columns", "the end of the line"},
    MalformedVeg{"NanCoordinate", "3 0 1 0", "3 0 nan 0", "line 5", "a y coordinate, a finite number", "'nan'"},
    MalformedVeg{"InfiniteCoordinate", "3 0 1 0", "3 -inf 1 0", "line 5", "an x coordinate", "'-inf'"},
    MalformedVeg{"CoordinateOutOfRange", "3 0 1 0", "3 0 1e999 0", "line 5", "a y coordinate", "'1e999'"},
    MalformedVeg{"CoordinateWithText", "3 0 1 0", "3 0 1.0x 0", "line 5", "a y coordinate", "'1.0x'"},
    MalformedVeg{"SecondVertices", "*SET first", "*VERTICES", "line 15", "one *VERTICES section", "'*VERTICES'"},
    MalformedVeg{"SecondElements", "*SET first", "*TETS", "line 15", "one section of elements", "'*TETS'"},
    MalformedVeg{"Hexahedra", "TET\n2", "CUBIC\n2", "line 9", "the element type TET", "'CUBIC'"},
    MalformedVeg{"MissingType", "TET\n2", "2", "line 9", "the element type TET", "'2 4 0'"},
    MalformedVeg{"SecondOrderTets", "2 4 0", "2 10 0", "line 10", "then 4", "'2 10 0'"},
    MalformedVeg{"NegativeTetCount", "2 4 0", "-2 4 0", "line 10", "the number of elements", "'-2 4 0'"},
    MalformedVeg{"TooFewTets", "2 2 3 4 5\n", "", "line 12", "tet 2, number 2 of 2", "'*MATERIAL SOFT'"},
    MalformedVeg{"TooManyTets", "2 4 0", "1 4 0", "line 12", "*MATERIAL", "'2 2 3 4 5'"},
    MalformedVeg{"UnknownVertex", "2 2 3 4 5", "2 2 3 4 6", "line 12", "the id of a vertex (1 to 5)", "'6'"},
    MalformedVeg{"VertexZero", "2 2 3 4 5", "2 0 3 4 5", "line 12", "the id of a vertex (1 to 5)", "'0'"},
    MalformedVeg{"NegativeVertex", "2 2 3 4 5", "2 2 -3 4 5", "line 12", "the id of a vertex", "'-3'"},
    MalformedVeg{"MissingCorner", "2 2 3 4 5", "2 2 3 4", "line 12", "the id of a vertex", "the end of the line"},
    MalformedVeg{"RealCorner", "2 2 3 4 5", "2 2 3.5 4 5", "line 12", "the id of a vertex", "'3.5'"},
    MalformedVeg{"DuplicateTetId", "2 2 3 4 5", "1 2 3 4 5", "line 12", "tet 2", "'1'"},
    MalformedVeg{"UnnamedMaterial", "*MATERIAL SOFT", "*MATERIAL", "line 13", "*MATERIAL and a name", "'*MATERIAL'"},
    MalformedVeg{"OtherMaterial", "ENU, 1000", "MOONEYRIVLIN, 1000", "line 14", "'ENU, density, E, nu'",
                 "MOONEYRIVLIN"},
    MalformedVeg{"MissingPoissonRatio", ", 0.4", "", "line 14", "Poisson's ratio", "the end of the line"},
    MalformedVeg{"Incompressible", "0.4", "0.5", "line 14", "Poisson's ratio in (-1, 0.5)", "0.5"},
    MalformedVeg{"NegativeModulus", "6.0e6", "-6.0e6", "line 14", "Young's modulus above 0", "-6.0e6"},
    MalformedVeg{"NoDensity", "1000", "0", "line 14", "a density above 0", "ENU, 0"},
    MalformedVeg{"RepeatedMaterial", "*SET first", "*MATERIAL SOFT\nENU, 1, 1, 0\n*SET first", "line 15",
                 "a name for each material", "'SOFT' a second time"},
    MalformedVeg{"UnnamedSet", "*SET first", "*SET", "line 15", "*SET and a name", "'*SET'"},
    MalformedVeg{"ReservedSet", "*SET first", "*SET allElements", "line 15", "a name for each set",
                 "'*SET allElements'"},
    MalformedVeg{"SetOfUnknownTet", "*SET first\n1", "*SET first\n1, 3", "line 16", "the id of a tet (1 to 2)", "'3'"},
    MalformedVeg{"SetWithText", "*SET first\n1", "*SET first\none", "line 16", "the id of a tet", "'one'"},
    MalformedVeg{"UnknownSet", "first, SOFT", "second, SOFT", "line 18", "allElements or a *SET", "'second'"},
    MalformedVeg{"UnknownMaterial", "first, SOFT", "first, HARD", "line 18", "a *MATERIAL of this file", "'HARD'"},
    MalformedVeg{"RegionOfOneWord", "first, SOFT", "first", "line 18", "'set, material'", "'first'"},
    MalformedVeg{"RegionAtTheEnd", "first, SOFT\n", "", "line 17", "'set, material'", "the end of the file"},
    MalformedVeg{"MissingInclude", "*SET first", "*INCLUDE gone.txt", "line 15", "*INCLUDE of a file", "no such file"},
    MalformedVeg{"UnnamedInclude", "*SET first", "*INCLUDE", "line 15", "the name of a file", "'*INCLUDE'"},
    MalformedVeg{"Binary", "3 0 1 0", "3 0 \x01\xff 0", "line 5", "a y coordinate", "'?\?'"},
};

INSTANTIATE_TEST_SUITE_P(Malformed, RefusesVeg, testing::ValuesIn(kMalformed),
                         [](const auto& param) { return std::string(param.param.name); });

}  // namespace veg_reader_test
}  // namespace exmat::precompute
