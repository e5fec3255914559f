#include "precompute/mesh_io/medit_reader.h"

#include <array>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "common/core/log.h"
#include "tests/precompute/mesh_io/mesh_samples.h"

namespace exmat::precompute {
namespace medit_reader_test {

using test::complaint_of;
using test::edited;
using test::TemporaryFolder;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::Pair;

constexpr auto kSound = R"(MeshVersionFormatted 2
# a comment
Dimension 3
Vertices
4
0 0 0 9
1 0 0 9  # the second
0 1 0 9
0 0 1 9
Triangles
1
1 2 3 4
Tetrahedra
1
1 2 3 4 7
End
)";

class ReadMedit : public testing::Test {
 protected:
  MeshFile read(const std::string& text) const { return read_medit(folder_.write("body.mesh", text)); }

  TemporaryFolder folder_;
};

TEST_F(ReadMedit, TakesVerticesTetsAndReferences) {
  const MeshFile result = read(kSound);
  ASSERT_EQ(result.mesh.vertex_count(), 4);
  EXPECT_EQ(result.mesh.vertices.row(2), Eigen::RowVector3d(0, 1, 0));
  ASSERT_EQ(result.mesh.tet_count(), 1);
  EXPECT_EQ(result.mesh.tets.row(0), Eigen::RowVector4i(0, 1, 2, 3));
  EXPECT_THAT(result.tet_sets, ElementsAre(Pair("7", ElementsAre(0))));
  EXPECT_FALSE(result.materials);
}

TEST_F(ReadMedit, TakesEveryVersionAndAnyLayout) {
  for (const auto version : {"1", "2", "3", "4"})
    EXPECT_EQ(read(edited(kSound, "Formatted 2", std::string("Formatted\n ") + version)).mesh.tet_count(), 1);
  EXPECT_EQ(read(edited(kSound, "1 2 3 4 7\nEnd", "1 2\n3 4\n7 End")).mesh.tet_count(), 1);
  EXPECT_THAT(read(edited(kSound, "1 2 3 4 7", "1 2 3 4 0")).tet_sets, ElementsAre());
  EXPECT_EQ(
      read(edited(kSound, "Triangles\n", "RequiredVertices\n2\n1 2\nSomething 3 0.5\nTriangles\n")).mesh.tet_count(),
      1);
}

TEST_F(ReadMedit, WarnsOfVolumeElementsLeftOut) {
  std::vector<std::string> warnings;
  log::set_sink([&](log::Level, std::string_view message) { warnings.emplace_back(message); });
  read(edited(kSound, "Triangles\n", "Hexahedra\n2\n1 2 3 4 1 2 3 4 0\n1 2 3 4 1 2 3 4 0\nTriangles\n"));
  log::set_sink({});
  EXPECT_THAT(warnings, ElementsAre(HasSubstr("2 Hexahedra are left out")));
}

struct Malformed {
  const char *name, *from, *to, *place, *expected, *found;
};

void PrintTo(const Malformed& malformed, std::ostream* stream) { *stream << malformed.name; }

class RefusesMedit : public testing::TestWithParam<Malformed> {};

TEST_P(RefusesMedit, WithPlaceExpectedAndFound) {
  const TemporaryFolder folder;
  const auto file = folder.write("bad.mesh", edited(kSound, GetParam().from, GetParam().to));
  const Complaint complaint = complaint_of([&] { read_medit(file); });
  EXPECT_EQ(complaint.file, file.string());
  EXPECT_EQ(complaint.place, GetParam().place);
  EXPECT_THAT(complaint.expected, HasSubstr(GetParam().expected));
  EXPECT_THAT(complaint.found, HasSubstr(GetParam().found));
}

constexpr std::array kMalformed{
    Malformed{"NotAMedit", "MeshVersionFormatted", "solid", "line 1", "MeshVersionFormatted", "'solid'"},
    Malformed{"Binary", "MeshVersionFormatted", "MeshVersionUnformatted", "line 1", "MeshVersionFormatted",
              "'MeshVersionUnformatted'"},
    Malformed{"UnknownVersion", "Formatted 2", "Formatted 5", "line 1", "a version from 1 to 4", "5"},
    Malformed{"TwoDimensions", "Dimension 3", "Dimension 2", "line 3", "dimension 3", "2"},
    Malformed{"VertexCountBeyondTheFile", "Vertices\n4", "Vertices\n4000000", "line 5",
              "vertices, which the rest of the file can hold", "4000000"},
    Malformed{"NegativeVertexCount", "Vertices\n4", "Vertices\n-4", "line 5", "the number of vertices", "'-4'"},
    Malformed{"VertexCountOutOfRange", "Vertices\n4", "Vertices\n99999999999999999999", "line 5",
              "the number of vertices", "'99999999999999999999'"},
    Malformed{"TooManyVertices", "Vertices\n4", "Vertices\n3", "line 9", "a keyword", "'0'"},
    Malformed{"TooFewVertices", "Vertices\n4", "Vertices\n5", "line 10", "an x coordinate", "'Triangles'"},
    Malformed{"NanCoordinate", "0 1 0 9", "0 nan 0 9", "line 8", "a y coordinate, a finite number", "'nan'"},
    Malformed{"InfiniteCoordinate", "0 1 0 9", "0 1e999 0 9", "line 8", "a y coordinate, a finite number", "'1e999'"},
    Malformed{"MissingReference", "0 0 1 9\n", "0 0 1\n", "line 10", "a vertex's reference number", "'Triangles'"},
    Malformed{"SecondVertices", "Triangles\n1\n1 2 3 4\n", "Vertices\n1\n1 2 3 4\n", "line 10", "one section Vertices",
              "a second one"},
    Malformed{"TetsFirst", "Vertices\n4\n0 0 0 9\n1 0 0 9  # the second\n0 1 0 9\n0 0 1 9\n", "", "line 7",
              "Vertices before Tetrahedra", "none"},
    Malformed{"TetCountBeyondTheFile", "Tetrahedra\n1", "Tetrahedra\n9", "line 14",
              "tetrahedra, which the rest of the file can hold", "9"},
    Malformed{"CornerZero", "1 2 3 4 7", "0 2 3 4 7", "line 15", "a vertex number from 1 to 4", "0"},
    Malformed{"CornerAbove", "1 2 3 4 7", "1 2 3 5 7", "line 15", "a vertex number from 1 to 4", "5"},
    Malformed{"CornerFarBelow", "1 2 3 4 7", "1 2 3 -2147483648 7", "line 15", "a vertex number from 1 to 4",
              "-2147483648"},
    Malformed{"CornerNotAnInteger", "1 2 3 4 7", "1 2 3.5 4 7", "line 15", "a vertex number from 1 to 4", "'3.5'"},
    Malformed{"HigherOrder", "Tetrahedra\n", "TetrahedraP2\n", "line 13", "first order", "'TetrahedraP2'"},
    Malformed{"NoTets", "Tetrahedra\n1\n1 2 3 4 7\n", "", "line 13", "Tetrahedra before End", "none"},
    Malformed{"NoEnd", "End\n", "", "line 16", "at last 'End'", "the end of the file"},
    Malformed{"AfterTheEnd", "End\n", "End\n5\n", "line 17", "nothing after End", "'5'"},
};

INSTANTIATE_TEST_SUITE_P(Malformed, RefusesMedit, testing::ValuesIn(kMalformed),
                         [](const auto& param) { return std::string(param.param.name); });

}  // namespace medit_reader_test
}  // namespace exmat::precompute
