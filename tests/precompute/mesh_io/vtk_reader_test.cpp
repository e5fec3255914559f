#include "precompute/mesh_io/vtk_reader.h"

#include <array>
#include <bit>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "common/core/log.h"
#include "tests/precompute/mesh_io/mesh_samples.h"

namespace exmat::precompute {
namespace vtk_reader_test {

using test::complaint_of;
using test::edited;
using test::TemporaryFolder;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::Pair;

constexpr auto kRows = R"(# vtk DataFile Version 4.2
a title
ASCII
DATASET UNSTRUCTURED_GRID

POINTS 4 float
0 0 0 1 0 0
0 1 0 0 0 1
CELLS 2 9
3 0 1 2
4 0 1 2 3
CELL_TYPES 2
5
10
)";

constexpr auto kOffsets = R"(# vtk DataFile Version 5.1
a title
ASCII
DATASET UNSTRUCTURED_GRID
POINTS 4 double
0 0 0 1 0 0 0 1 0 0 0 1
CELLS 3 7
OFFSETS vtktypeint64
0 3 7
CONNECTIVITY vtktypeint64
0 1 2 0 1 2 3
CELL_TYPES 2
5 10
)";

constexpr auto kData = R"(CELL_DATA 2
SCALARS region int 1
LOOKUP_TABLE default
4 7
SCALARS density double
LOOKUP_TABLE default
1 nan
VECTORS fibre float
0 0 1 0 0 1
FIELD FieldData 2
part 1 2 vtkIdType
3 3
METADATA
INFORMATION 0

wide 2 2 unsigned_char
1 2 3 4
POINT_DATA 4
SCALARS mark int
LOOKUP_TABLE colours
1 2 3 4
LOOKUP_TABLE colours 2
0 0 0 1 1 1 1 1
NORMALS normals float
0 0 1 0 0 1 0 0 1 0 0 1
COLOR_SCALARS tint 1
0.5 0.5 0.5 1
TEXTURE_COORDINATES uv 2 float
0 0 1 0 0 1 1 1
)";

class ReadVtk : public testing::Test {
 protected:
  MeshFile read(const std::string& bytes) const { return read_vtk(folder_.write("body.vtk", bytes)); }
  Complaint complaint_of_reading(const std::string& bytes) const {
    return complaint_of([&] { read(bytes); });
  }

  TemporaryFolder folder_;
};

TEST_F(ReadVtk, TakesTheTetsAmongTheCells) {
  for (const auto text : {kRows, kOffsets}) {
    const MeshFile result = read(text);
    ASSERT_EQ(result.mesh.vertex_count(), 4);
    EXPECT_EQ(result.mesh.vertices.row(2), Eigen::RowVector3d(0, 1, 0));
    ASSERT_EQ(result.mesh.tet_count(), 1);
    EXPECT_EQ(result.mesh.tets.row(0), Eigen::RowVector4i(0, 1, 2, 3));
    EXPECT_TRUE(result.tet_sets.empty());
    EXPECT_FALSE(result.materials);
  }
}

TEST_F(ReadVtk, IntegersOfTheCellsAreRegionsAndOtherDataAreLeftOut) {
  for (const auto text : {kRows, kOffsets})
    EXPECT_THAT(read(std::string(text) + kData).tet_sets,
                ElementsAre(Pair("part 3", ElementsAre(0)), Pair("region 7", ElementsAre(0))));
}

TEST_F(ReadVtk, NeedsNoLineEndAfterTheLastLine) {
  const std::string whole = kRows;
  EXPECT_TRUE(test::same_mesh(read(whole.substr(0, whole.size() - 1)).mesh, read(whole).mesh));
  const std::string with_data = whole + "CELL_DATA 2\nSCALARS part int\nLOOKUP_TABLE default\n3 12";
  EXPECT_THAT(read(with_data).tet_sets, testing::ElementsAre(testing::Pair("part 12", testing::ElementsAre(0))));
}

TEST_F(ReadVtk, WarnsOfVolumeCellsLeftOut) {
  std::vector<std::string> warnings;
  log::set_sink([&](log::Level, std::string_view message) { warnings.emplace_back(message); });
  read(edited(edited(edited(kRows, "CELLS 2 9", "CELLS 3 18"), "3 0 1 2\n", "3 0 1 2\n8 0 1 2 3 0 1 2 3\n"),
              "CELL_TYPES 2\n5\n", "CELL_TYPES 3\n5\n12\n"));
  log::set_sink({});
  EXPECT_THAT(warnings, ElementsAre(HasSubstr("1 hexahedra (cell type 12) are left out")));
}

// Largest and smallest values of each type, in the file's byte order.
TEST_F(ReadVtk, TakesBinaryNumbersOfEveryType) {
  const bool swap = std::endian::native == std::endian::little;
  const auto bytes = [&](auto value) {
    std::string raw(reinterpret_cast<const char*>(&value), sizeof(value));
    if (swap) std::reverse(raw.begin(), raw.end());
    return raw;
  };
  const std::string head = test::to_vtk(test::sample_mesh(1), true, false);  // a triangle and six tets
  const std::string mesh = head.substr(0, head.find("CELL_DATA"));
  const auto sets_of = [&](const std::string& type, const std::string& low, const std::string& high) {
    std::string data = "CELL_DATA 7\nSCALARS a " + type + " 1\nLOOKUP_TABLE default\n" + low;
    for (int k = 0; k < 5; ++k) data += low;
    const MeshFile result = read(mesh + data + high + "\n");
    std::vector<std::string> names;
    for (const auto& [name, tets] : result.tet_sets) names.push_back(name);
    return names;
  };
  EXPECT_THAT(sets_of("char", bytes(std::int8_t{-128}), bytes(std::int8_t{127})), ElementsAre("a -128", "a 127"));
  EXPECT_THAT(sets_of("unsigned_char", bytes(std::uint8_t{0}), bytes(std::uint8_t{255})), ElementsAre("a 0", "a 255"));
  EXPECT_THAT(sets_of("short", bytes(std::int16_t{-32768}), bytes(std::int16_t{2})), ElementsAre("a -32768", "a 2"));
  EXPECT_THAT(sets_of("unsigned_short", bytes(std::uint16_t{1}), bytes(std::uint16_t{65535})),
              ElementsAre("a 1", "a 65535"));
  EXPECT_THAT(sets_of("vtkIdType", bytes(std::int32_t{-5}), bytes(std::int32_t{7})), ElementsAre("a -5", "a 7"));
  EXPECT_THAT(sets_of("unsigned_int", bytes(std::uint32_t{1}), bytes(std::uint32_t{4294967295})),
              ElementsAre("a 1", "a 4294967295"));
  EXPECT_THAT(sets_of("vtktypeint64", bytes(std::int64_t{-1}), bytes(std::int64_t{1} << 40)),
              ElementsAre("a -1", "a 1099511627776"));
  EXPECT_THAT(sets_of("float", bytes(1.0F), bytes(2.0F)), ElementsAre());
  const std::string points = edited(mesh, "POINTS 8 double", "POINTS 8 float");
  const std::size_t begin = points.find("float\n") + 6;
  std::string floats;
  for (int k = 0; k < 24; ++k) floats += bytes(0.5F * static_cast<float>(k));
  EXPECT_EQ(read(points.substr(0, begin) + floats + points.substr(begin + 24 * 8)).mesh.vertices.row(1),
            Eigen::RowVector3d(1.5, 2, 2.5));
}

TEST_F(ReadVtk, RefusesBinaryCountsBeyondTheFile) {
  const std::string bytes = test::to_vtk(test::sample_mesh(1), true, true);
  const Complaint points = complaint_of_reading(edited(bytes, "POINTS 8 ", "POINTS 800000000 "));
  EXPECT_THAT(points.place, HasSubstr("byte "));
  EXPECT_THAT(points.expected, HasSubstr("which the rest of the file can hold"));
  EXPECT_EQ(points.found, "800000000");
  EXPECT_THAT(complaint_of_reading(edited(bytes, "CELLS 8 27", "CELLS 4000000000 27")).expected,
              HasSubstr("offsets of cells, which the rest of the file can hold"));
  EXPECT_THAT(complaint_of_reading(edited(bytes, "CELLS 8 27", "CELLS 8 9223372036854775807")).expected,
              HasSubstr("the last offset"));
}

struct Malformed {
  const char *name, *text, *from, *to, *place, *expected, *found;
};

void PrintTo(const Malformed& malformed, std::ostream* stream) { *stream << malformed.name; }

class RefusesVtk : public testing::TestWithParam<Malformed> {};

TEST_P(RefusesVtk, WithPlaceExpectedAndFound) {
  const TemporaryFolder folder;
  const auto file = folder.write("bad.vtk", edited(GetParam().text, GetParam().from, GetParam().to));
  const Complaint complaint = complaint_of([&] { read_vtk(file); });
  EXPECT_EQ(complaint.file, file.string());
  EXPECT_EQ(complaint.place, GetParam().place);
  EXPECT_THAT(complaint.expected, HasSubstr(GetParam().expected));
  EXPECT_THAT(complaint.found, HasSubstr(GetParam().found));
}

constexpr std::array kMalformed{
    Malformed{"NotAVtk", kRows, "# vtk DataFile Version 4.2", "<VTKFile>", "line 1", "'# vtk DataFile Version'",
              "'<VTKFile>'"},
    Malformed{"UnknownVersion", kRows, "Version 4.2", "Version 7.0", "line 1", "1 to 5.1", "Version 7.0'"},
    Malformed{"UnknownEncoding", kRows, "ASCII", "BASE64", "line 3", "ASCII or BINARY", "'BASE64'"},
    Malformed{"OtherDataset", kRows, "UNSTRUCTURED_GRID", "POLYDATA", "line 4", "DATASET UNSTRUCTURED_GRID",
              "'POLYDATA'"},
    Malformed{"PointCountBeyondTheFile", kRows, "POINTS 4", "POINTS 400", "line 6",
              "which the rest of the file can hold", "400"},
    Malformed{"NegativePointCount", kRows, "POINTS 4", "POINTS -4", "line 6", "the number of points", "'-4'"},
    Malformed{"TooManyPoints", kRows, "POINTS 4", "POINTS 3", "line 8", "a keyword of an unstructured grid", "'0'"},
    Malformed{"TooFewPoints", kRows, "POINTS 4", "POINTS 5", "line 9", "an x coordinate", "'CELLS'"},
    Malformed{"PointsOfStrings", kRows, "4 float", "4 string", "line 6", "a type of numbers", "'string'"},
    Malformed{"NanCoordinate", kRows, "0 1 0 0 0 1", "0 nan 0 0 0 1", "line 8", "a y coordinate, a finite number",
              "'nan'"},
    Malformed{"SecondPoints", kRows, "CELLS 2 9", "POINTS 1 float\n0 0 0\nCELLS 2 9", "line 9", "POINTS once",
              "a second time"},
    Malformed{"CellsFirst", kRows, "POINTS 4 float\n0 0 0 1 0 0\n0 1 0 0 0 1\n", "", "line 6", "POINTS before CELLS",
              "none"},
    Malformed{"CellCountBeyondTheFile", kRows, "CELLS 2 9", "CELLS 2000000000 9", "line 9",
              "cells, which the rest of the file can hold", "2000000000"},
    Malformed{"SizeTooSmall", kRows, "CELLS 2 9", "CELLS 2 8", "line 11", "a cell of 0 to 3 points", "4"},
    Malformed{"SizeTooLarge", kRows, "CELLS 2 9", "CELLS 2 10", "line 11", "10 values of CELLS", "9"},
    Malformed{"NegativeCorners", kRows, "3 0 1 2", "-3 0 1 2", "line 10", "a cell of 0 to 8 points", "-3"},
    Malformed{"PointAbove", kRows, "4 0 1 2 3", "4 0 1 2 4", "line 11", "a point from 0 to 3", "4"},
    Malformed{"PointBelow", kRows, "4 0 1 2 3", "4 0 1 2 -1", "line 11", "a point from 0 to 3", "-1"},
    Malformed{"OtherCountOfTypes", kRows, "CELL_TYPES 2", "CELL_TYPES 3", "line 12", "CELL_TYPES 2, as of CELLS",
              "'3'"},
    Malformed{"MissingType", kRows, "5\n10\n", "5\n", "line 14", "the type of a cell", "the end of the file"},
    Malformed{"CutType", kRows, "10\n", "1", "line 14", "1 point of a vertex (cell type 1)", "4 of cell 1"},
    Malformed{"NoTypes", kRows, "CELL_TYPES 2\n5\n10\n", "", "line 11", "CELL_TYPES", "the end of the file"},
    Malformed{"TriangleAsTet", kRows, "5\n10\n", "10\n10\n", "line 13", "4 points of a tet (cell type 10)",
              "3 of cell 0"},
    Malformed{"SecondOrder", kRows, "5\n10\n", "5\n24\n", "line 14", "first order (cell type 10)", "cell type 24"},
    Malformed{"NoTets", kRows, "5\n10\n", "5\n9\n", "line 14", "tets (cell type 10)",
              "1 triangles (cell type 5), 1 quadrilaterals (cell type 9)"},
    Malformed{"RowsInVersion5", kOffsets, "OFFSETS vtktypeint64\n", "", "line 8", "OFFSETS after CELLS", "'0'"},
    Malformed{"FirstOffsetNotZero", kOffsets, "0 3 7", "1 3 7", "line 9", "0, the first offset", "1"},
    Malformed{"OffsetsDescend", kOffsets, "0 3 7", "0 3 2", "line 9", "an offset from 3 to 7", "2"},
    Malformed{"OffsetBeyond", kOffsets, "0 3 7", "0 9 7", "line 9", "an offset from 0 to 7", "9"},
    Malformed{"LastOffsetTooSmall", kOffsets, "0 3 7", "0 3 6", "line 9", "7, the last offset", "6"},
    Malformed{"NoConnectivity", kOffsets, "CONNECTIVITY", "CONNECTIONS", "line 10", "CONNECTIVITY after OFFSETS",
              "'CONNECTIONS'"},
    Malformed{"CornerAboveInVersion5", kOffsets, "0 1 2 0 1 2 3", "0 1 2 0 1 2 4", "line 11", "a point from 0 to 3",
              "4"},
    Malformed{"DataBeforeCells", kRows, "CELLS 2 9", "CELL_DATA 0\nSCALARS a int\nLOOKUP_TABLE b\nCELLS 2 9", "line 9",
              "CELLS before CELL_DATA", "none"},
    Malformed{"DataBeforePoints", kRows, "POINTS 4", "POINT_DATA 0\nPOINTS 4", "line 6", "POINTS before POINT_DATA",
              "none"},
    Malformed{"DataOfOtherCount", kRows, "5\n10\n", "5\n10\nCELL_DATA 3\n", "line 15", "CELL_DATA 2", "'3'"},
    Malformed{"UnknownKeyword", kRows, "5\n10\n", "5\n10\nMATERIALS 3\n", "line 15", "a keyword", "'MATERIALS'"},
    Malformed{"FieldOfStrings", kRows, "5\n10\n", "5\n10\nFIELD data 1\nname 1 1 string\nsteel\n", "line 16",
              "a type of numbers", "'string'"},
    Malformed{"HugeFieldArray", kRows, "5\n10\n", "5\n10\nFIELD data 1\nname 9999 1 int\n1\n", "line 16",
              "at most 1000 components", "9999"},
    Malformed{"FieldBeyondTheFile", kRows, "5\n10\n", "5\n10\nFIELD data 1\nname 1000 2000000000 int\n1\n", "line 16",
              "which the rest of the file can hold", "2000000000"},
    Malformed{"ScalarsWithoutTable", kRows, "5\n10\n", "5\n10\nCELL_DATA 2\nSCALARS a int\n1 2\n", "line 17",
              "LOOKUP_TABLE after SCALARS", "'1'"},
};

INSTANTIATE_TEST_SUITE_P(Malformed, RefusesVtk, testing::ValuesIn(kMalformed),
                         [](const auto& param) { return std::string(param.param.name); });

}  // namespace vtk_reader_test
}  // namespace exmat::precompute
