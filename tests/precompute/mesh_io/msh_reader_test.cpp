#include "precompute/mesh_io/msh_reader.h"

#include <array>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <limits>
#include <string>

#include "common/core/log.h"
#include "tests/precompute/mesh_io/mesh_samples.h"

namespace exmat::precompute {
namespace msh_reader_test {

using test::ByteWriter;
using test::complaint_of;
using test::edited;
using test::TemporaryFolder;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::Pair;

constexpr auto kSound22 = R"($MeshFormat
2.2 0 8
$EndMeshFormat
$PhysicalNames
1
3 7 "soft part"
$EndPhysicalNames
$Nodes
4
10 0 0 0
20 1 0 0
30 0 1 0
40 0 0 1
$EndNodes
$Elements
3
1 15 2 0 1 10
2 4 2 7 1 10 20 30 40
3 2 0 10 20 30
$EndElements
)";

constexpr auto kSound41 = R"($MeshFormat
4.1 0 8
$EndMeshFormat
$Entities
0 0 0 1
1 0 0 0 1 1 1 1 7 0
$EndEntities
$Nodes
2 4 10 40
3 1 0 3
10
20
30
0 0 0
1 0 0
0 1 0
3 1 0 1
40
0 0 1
$EndNodes
$Elements
1 1 1 1
3 1 4 1
1 10 20 30 40
$EndElements
)";

class ReadMsh : public testing::Test {
 protected:
  MeshFile read(const std::string& bytes) const { return read_msh(folder_.write("mesh.msh", bytes)); }
  Complaint complaint_of_reading(const std::string& bytes) const {
    return complaint_of([&] { read(bytes); });
  }

  TemporaryFolder folder_;
};

TEST_F(ReadMsh, TakesSparseTagsInTheOrderOfTheFile) {
  for (const auto text : {kSound22, kSound41}) {
    const MeshFile result = read(text);
    ASSERT_EQ(result.mesh.vertex_count(), 4);
    EXPECT_EQ(result.mesh.vertices.row(2), Eigen::RowVector3d(0, 1, 0));
    ASSERT_EQ(result.mesh.tet_count(), 1);
    EXPECT_EQ(result.mesh.tets.row(0), Eigen::RowVector4i(0, 1, 2, 3));
    EXPECT_FALSE(result.materials);
  }
}

TEST_F(ReadMsh, NamesSetsByTheirGroupOrItsNumber) {
  EXPECT_THAT(read(kSound22).tet_sets, ElementsAre(Pair("soft part", ElementsAre(0))));
  EXPECT_THAT(read(kSound41).tet_sets, ElementsAre(Pair("7", ElementsAre(0))));
  EXPECT_THAT(read(edited(kSound22, "4 2 7 1", "4 2 0 1")).tet_sets, ElementsAre());
  EXPECT_THAT(read(edited(kSound41, "1 7 0\n", "1 -7 0\n")).tet_sets, ElementsAre(Pair("7", ElementsAre(0))));
}

TEST_F(ReadMsh, MergesTheCopiesOfATetInSeveralGroupsOf22) {
  const MeshFile result = read(edited(edited(kSound22, "$Elements\n3", "$Elements\n4"), "3 2 0 10 20 30",
                                      "3 2 0 10 20 30\n4 4 2 8 1 10 20 30 40"));
  EXPECT_EQ(result.mesh.tet_count(), 1);
  EXPECT_THAT(result.tet_sets, ElementsAre(Pair("8", ElementsAre(0)), Pair("soft part", ElementsAre(0))));
}

TEST_F(ReadMsh, KeepsATetThatStandsTwiceInOneGroupOf22) {
  const MeshFile result = read(edited(edited(kSound22, "$Elements\n3", "$Elements\n4"), "3 2 0 10 20 30",
                                      "3 2 0 10 20 30\n4 4 2 7 1 10 20 30 40"));
  EXPECT_EQ(result.mesh.tet_count(), 2);
}

TEST_F(ReadMsh, TakesAnyNumberOfTagsOf22) {
  EXPECT_EQ(read(edited(kSound22, "4 2 7 1", "4 4 7 1 1 3")).tet_sets.size(), 1U);
  EXPECT_EQ(read(edited(kSound22, "4 2 7 1", "4 1 7")).tet_sets.size(), 1U);
  EXPECT_EQ(read(edited(kSound22, "4 2 7 1", "4 0")).tet_sets.size(), 0U);
}

TEST_F(ReadMsh, PassesOverOtherSections) {
  const auto comments = "$Comments\nmade by $hand\n$EndComments\n$Nodes\n";
  EXPECT_EQ(read(edited(kSound22, "$Nodes\n", comments)).mesh.tet_count(), 1);
  EXPECT_EQ(read(edited(kSound41, "$Nodes\n", comments)).mesh.tet_count(), 1);
  EXPECT_EQ(read(std::string(kSound41) + "$Periodic\n0\n$EndPeriodic\n").mesh.tet_count(), 1);
}

TEST_F(ReadMsh, WarnsOfVolumeElementsLeftOut) {
  std::vector<std::string> warnings;
  log::set_sink([&](log::Level, std::string_view message) { warnings.emplace_back(message); });
  read(edited(kSound22, "3 2 0 10 20 30", "3 7 0 10 20 30 40 10"));
  log::set_sink({});
  EXPECT_THAT(warnings, ElementsAre(HasSubstr("1 pyramids (element type 7) are left out")));
}

struct MalformedMsh {
  const char *name, *text, *from, *to, *place, *expected, *found;
};

void PrintTo(const MalformedMsh& malformed, std::ostream* stream) { *stream << malformed.name; }

class RefusesMsh : public testing::TestWithParam<MalformedMsh> {};

TEST_P(RefusesMsh, WithPlaceExpectedAndFound) {
  const TemporaryFolder folder;
  const auto file = folder.write("bad.msh", edited(GetParam().text, GetParam().from, GetParam().to));
  const Complaint complaint = complaint_of([&] { read_msh(file); });
  EXPECT_EQ(complaint.file, file.string());
  EXPECT_EQ(complaint.place, GetParam().place);
  EXPECT_THAT(complaint.expected, HasSubstr(GetParam().expected));
  EXPECT_THAT(complaint.found, HasSubstr(GetParam().found));
}

constexpr std::array kMalformed{
    MalformedMsh{"NotAMsh", kSound22, kSound22, "solid\n", "line 1", "a section that begins with '$'", "'solid'"},
    MalformedMsh{"FormatNotFirst", kSound22, "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n", "", "line 1", "$MeshFormat",
                 "another beginning"},
    MalformedMsh{"OldVersion", kSound22, "2.2 0 8", "1.0 0 8", "line 2", "version 2.2 or 4.1", "'1.0'"},
    MalformedMsh{"Version40", kSound41, "4.1 0 8", "4 0 8", "line 2", "version 2.2 or 4.1", "'4'"},
    MalformedMsh{"VersionNotANumber", kSound22, "2.2 0 8", "new 0 8", "line 2", "version 2.2 or 4.1", "'new'"},
    MalformedMsh{"UnknownFileType", kSound22, "2.2 0 8", "2.2 2 8", "line 2", "file type 0 (text) or 1", "'2'"},
    MalformedMsh{"OtherDataSize", kSound22, "2.2 0 8", "2.2 0 4", "line 2", "data size 8", "'4'"},
    MalformedMsh{"MissingDataSize", kSound22, "2.2 0 8", "2.2 0", "line 2", "data size 8", "the end of the line"},
    MalformedMsh{"UnclosedFormat", kSound22, "$EndMeshFormat\n", "", "line 3", "$EndMeshFormat", "'$PhysicalNames'"},
    MalformedMsh{"TextAfterASectionName", kSound22, "$Nodes\n4", "$Nodes 4", "line 8", "the end of the line", "'4'"},
    MalformedMsh{"NameWithoutQuotes", kSound22, "3 7 \"soft part\"", "3 7 soft", "line 6", "'dimension tag \"name\"'",
                 "'3 7 soft'"},
    MalformedMsh{"MissingName", kSound22, "$PhysicalNames\n1", "$PhysicalNames\n2", "line 7",
                 "'dimension tag \"name\"'", "'$EndPhysicalNames'"},
    MalformedMsh{"NameOfAWideTag", kSound22, "3 7 \"soft part\"", "3 4294967303 \"soft part\"", "line 6",
                 "'dimension tag \"name\"'", "'3 4294967303"},
    MalformedMsh{"NegativeNodeCount", kSound22, "$Nodes\n4", "$Nodes\n-4", "line 9", "the number of nodes", "'-4'"},
    MalformedMsh{"NodeCountBeyondTheFile", kSound22, "$Nodes\n4", "$Nodes\n1000000000", "line 9",
                 "which the rest of the file can hold", "1000000000"},
    MalformedMsh{"NodeCountOutOfRange", kSound22, "$Nodes\n4", "$Nodes\n99999999999999999999", "line 9",
                 "the number of nodes", "'99999999999999999999'"},
    MalformedMsh{"TooManyNodes", kSound22, "$Nodes\n4", "$Nodes\n3", "line 13", "$EndNodes", "'40'"},
    MalformedMsh{"TooFewNodes", kSound22, "$Nodes\n4", "$Nodes\n5", "line 14", "a node tag", "'$EndNodes'"},
    MalformedMsh{"DuplicateNode", kSound22, "30 0 1 0", "20 0 1 0", "line 12", "a tag for each node",
                 "node 20 a second time"},
    MalformedMsh{"NodeZero", kSound22, "30 0 1 0", "0 0 1 0", "line 12", "a node tag above 0", "0"},
    MalformedMsh{"NegativeNode", kSound22, "30 0 1 0", "-30 0 1 0", "line 12", "a node tag above 0", "-30"},
    MalformedMsh{"MissingCoordinate", kSound22, "30 0 1 0", "30 0 1", "line 12", "a z coordinate",
                 "the end of the line"},
    MalformedMsh{"ExtraCoordinate", kSound22, "30 0 1 0", "30 0 1 0 7", "line 12", "an x coordinate",
                 "the end of the line"},
    MalformedMsh{"NanCoordinate", kSound22, "30 0 1 0", "30 0 NaN 0", "line 12", "a y coordinate, a finite number",
                 "'NaN'"},
    MalformedMsh{"CoordinateWithComma", kSound22, "30 0 1 0", "30 0 1,0 0", "line 12", "a y coordinate", "'1,0'"},
    MalformedMsh{"NoNodes", kSound22, "$Nodes\n4\n10 0 0 0\n20 1 0 0\n30 0 1 0\n40 0 0 1\n$EndNodes\n", "", "line 8",
                 "$Nodes before $Elements", "none"},
    MalformedMsh{"ParametricNodes22", kSound22, "$Nodes\n", "$ParametricNodes\n", "line 8", "a $Nodes section",
                 "$ParametricNodes"},
    MalformedMsh{"SecondNodes", kSound22, "$Elements\n", "$Nodes\n", "line 15", "one $Nodes section", "a second one"},
    MalformedMsh{"NoElements", kSound22,
                 "$Elements\n3\n1 15 2 0 1 10\n2 4 2 7 1 10 20 30 40\n3 2 0 10 20 30\n$EndElements\n", "", "line 15",
                 "a $Elements section", "the end of the file"},
    MalformedMsh{"UnclosedElements", kSound22, "$EndElements\n", "", "line 20", "$EndElements", "the end of the file"},
    MalformedMsh{"ElementCountBeyondTheFile", kSound22, "$Elements\n3", "$Elements\n2147483647", "line 16",
                 "which the rest of the file can hold", "2147483647"},
    MalformedMsh{"TooManyElements", kSound22, "$Elements\n3", "$Elements\n2", "line 19", "$EndElements", "'3'"},
    MalformedMsh{"TooFewElements", kSound22, "$Elements\n3", "$Elements\n4", "line 20", "an element number",
                 "'$EndElements'"},
    MalformedMsh{"UnknownNode", kSound22, "10 20 30 40", "10 20 30 41", "line 18", "the tag of one of the 4 nodes",
                 "41"},
    MalformedMsh{"NegativeNodeOfATet", kSound22, "10 20 30 40", "10 20 30 -40", "line 18", "a node tag above 0", "-40"},
    MalformedMsh{"MissingCorner", kSound22, "10 20 30 40", "10 20 30", "line 18", "a node tag", "the end of the line"},
    MalformedMsh{"SecondOrder", kSound22, "2 4 2 7", "2 11 2 7", "line 18", "tetrahedra of first order",
                 "higher order (element type 11)"},
    MalformedMsh{"UnknownType", kSound22, "3 2 0 10", "3 99 0 10", "line 19", "a known element type", "99"},
    MalformedMsh{"TypeZero", kSound22, "3 2 0 10", "3 0 0 10", "line 19", "a known element type", "0"},
    MalformedMsh{"NegativeTagCount", kSound22, "4 2 7 1", "4 -2 7 1", "line 18", "the number of tags", "-2"},
    MalformedMsh{"HugeTagCount", kSound22, "4 2 7 1", "4 2000000000 7 1", "line 18", "a tag", "the end of the line"},
    MalformedMsh{"NoTets", kSound22, "2 4 2 7 1 10 20 30 40", "2 3 2 7 1 10 20 30 40", "line 21",
                 "tetrahedra (element type 4)", "1 triangles (element type 2), 1 quadrangles (element type 3)"},
    MalformedMsh{"UnclosedUnknownSection", kSound41, "$Nodes\n", "$Notes\n", "line 8", "$EndNotes after $Notes",
                 "the end of the file"},
    MalformedMsh{"Partitioned", kSound41, "$Nodes\n", "$PartitionedEntities\n", "line 8", "a mesh in one piece",
                 "a partitioned one"},
    MalformedMsh{"EntityCountBeyondTheFile", kSound41, "0 0 0 1\n", "0 0 0 99999\n", "line 5",
                 "which the rest of the file can hold", "99999"},
    MalformedMsh{"EntityWithHugeGroupCount", kSound41, "1 1 1 1 7 0", "1 1 1 99999 7 0", "line 6", "at most", "99999"},
    MalformedMsh{"EntityWithTooFewGroups", kSound41, "1 1 1 1 7 0", "1 1 1 3 7 0", "line 6", "a physical tag",
                 "the end of the line"},
    MalformedMsh{"EntitiesLast", kSound41, "$Elements\n1 1 1 1\n3 1 4 1\n1 10 20 30 40\n$EndElements\n",
                 "$Elements\n1 1 1 1\n3 1 4 1\n1 10 20 30 40\n$EndElements\n$Entities\n", "line 26",
                 "$Entities before $Elements", "after"},
    MalformedMsh{"NodeBlockTooLarge", kSound41, "3 1 0 3", "3 1 0 5", "line 10", "at most 4 more of the 4 nodes", "5"},
    MalformedMsh{"NodeBlocksTooSmall", kSound41, "2 4 10 40", "2 5 10 40", "line 19", "5 nodes in all blocks", "4"},
    MalformedMsh{"NodeBlockCountBeyondTheFile", kSound41, "2 4 10 40", "200 4 10 40", "line 9", "at most", "200"},
    MalformedMsh{"NegativeBlock", kSound41, "3 1 0 3", "3 1 0 -3", "line 10", "the number of nodes of a block", "'-3'"},
    MalformedMsh{"FourDimensions", kSound41, "3 1 0 3", "4 1 0 3", "line 10", "0 to 3", "4"},
    MalformedMsh{"NeitherParametricNorNot", kSound41, "3 1 0 3", "3 1 2 3", "line 10", "0 or 1 (parametric)", "2"},
    MalformedMsh{"MissingParameters", kSound41, "3 1 0 3", "3 1 1 3", "line 14", "a parametric coordinate",
                 "the end of the line"},
    MalformedMsh{"DuplicateNode41", kSound41, "40\n0 0 1", "20\n0 0 1", "line 18", "a tag for each node", "node 20"},
    MalformedMsh{"NanCoordinate41", kSound41, "0 1 0\n", "0 nan 0\n", "line 16", "a y coordinate", "'nan'"},
    MalformedMsh{"ElementBlockTooLarge", kSound41, "3 1 4 1\n", "3 1 4 2\n", "line 23", "at most 1 more", "2"},
    MalformedMsh{"ElementBlocksTooSmall", kSound41, "1 1 1 1\n3 1 4 1", "1 2 1 1\n3 1 4 1", "line 24",
                 "2 elements in all blocks", "1"},
    MalformedMsh{"UnknownNode41", kSound41, "1 10 20 30 40", "1 10 20 30 50", "line 24", "one of the 4 nodes", "50"},
    MalformedMsh{"SecondOrder41", kSound41, "3 1 4 1\n", "3 1 11 1\n", "line 23", "first order", "type 11"},
};

INSTANTIATE_TEST_SUITE_P(Malformed, RefusesMsh, testing::ValuesIn(kMalformed),
                         [](const auto& param) { return std::string(param.param.name); });

// Every tet is noted in every group of its volume: many of each would take their product.
TEST_F(ReadMsh, RefusesAVolumeOfManyGroups) {
  std::string groups = "1 1 1 101";
  for (int i = 0; i < 101; ++i) groups += " " + std::to_string(i + 1);
  const Complaint complaint = complaint_of_reading(edited(std::string(kSound41), "1 1 1 1 7", groups));
  EXPECT_EQ(complaint.place, "line 6");
  EXPECT_EQ(complaint.expected, "at most 100 physical tags of an entity");
  EXPECT_EQ(complaint.found, "101");
}

/// `bytes` with the value that stands `offset` bytes after the first `marker` replaced.
template <typename Value>
std::string patched(std::string bytes, std::string_view marker, std::size_t offset, Value value) {
  const std::size_t begin = bytes.find(marker);
  EXPECT_NE(begin, std::string::npos);
  return bytes.replace(begin + marker.size() + offset, sizeof(value), reinterpret_cast<const char*>(&value),
                       sizeof(value));
}

std::string place_after(const std::string& bytes, std::string_view marker, std::size_t offset) {
  return "byte " + std::to_string(bytes.find(marker) + marker.size() + offset);
}

TEST_F(ReadMsh, RefusesAByteOrderMarkThatIsNotOne) {
  const std::string bytes = test::to_msh_41_binary(test::sample_mesh(1));
  const Complaint complaint = complaint_of_reading(patched(bytes, "4.1 1 8\n", 0, std::int32_t{2}));
  EXPECT_EQ(complaint.place, "byte 20");
  EXPECT_THAT(complaint.expected, HasSubstr("the integer 1"));
  EXPECT_EQ(complaint.found, "2");
}

TEST_F(ReadMsh, RefusesBinaryCountsBeyondTheFile) {
  const std::string bytes = test::to_msh_41_binary(test::sample_mesh(1));
  for (const std::uint64_t count : {std::uint64_t{1} << 31, std::uint64_t{1} << 40, ~std::uint64_t{0}}) {
    const Complaint nodes = complaint_of_reading(patched(bytes, "$Nodes\n", 8, count));
    EXPECT_EQ(nodes.place, place_after(bytes, "$Nodes\n", 8));
    EXPECT_THAT(nodes.expected, HasSubstr("nodes, which the rest of the file can hold"));
    EXPECT_EQ(nodes.found, std::to_string(count));
    const Complaint elements = complaint_of_reading(patched(bytes, "$Elements\n", 8, count));
    EXPECT_THAT(elements.expected, HasSubstr("elements, which the rest of the file can hold"));
    const Complaint entities = complaint_of_reading(patched(bytes, "$Entities\n", 24, count));
    EXPECT_THAT(entities.expected, HasSubstr("entities, which the rest of the file can hold"));
  }
}

TEST_F(ReadMsh, RefusesABinaryBlockLargerThanItsSection) {
  const std::string bytes = test::to_msh_41_binary(test::sample_mesh(1));
  const Complaint complaint = complaint_of_reading(patched(bytes, "$Nodes\n", 32 + 12, std::uint64_t{9}));
  EXPECT_EQ(complaint.place, place_after(bytes, "$Nodes\n", 44));
  EXPECT_EQ(complaint.expected, "at most 8 more of the 8 nodes declared");
  EXPECT_EQ(complaint.found, "9");
}

TEST_F(ReadMsh, RefusesABinaryCoordinateThatIsNotFinite) {
  const std::string bytes = test::to_msh_41_binary(test::sample_mesh(1));
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const Complaint complaint = complaint_of_reading(patched(bytes, "$Nodes\n", 32 + 20 + 8 + 8, nan));
  EXPECT_EQ(complaint.place, place_after(bytes, "$Nodes\n", 68));
  EXPECT_EQ(complaint.expected, "a y coordinate, a finite number");
  EXPECT_EQ(complaint.found, "nan");
}

TEST_F(ReadMsh, RefusesABinaryTetOfAnUnknownNode) {
  const std::string bytes = test::to_msh_41_binary(test::sample_mesh(1));
  const std::size_t last_corner = bytes.find("\n$EndElements") - 8;
  const Complaint complaint = complaint_of_reading(patched(bytes, "", last_corner, std::uint64_t{12345}));
  EXPECT_EQ(complaint.place, "byte " + std::to_string(last_corner));
  EXPECT_EQ(complaint.expected, "the tag of one of the 8 nodes");
  EXPECT_EQ(complaint.found, "12345");
}

TEST_F(ReadMsh, RefusesABinaryBlockOf22LargerThanItsSection) {
  const std::string bytes = test::to_msh_22_binary(test::sample_mesh(1));
  for (const std::int32_t size : {-1, 0, 1000}) {
    const Complaint complaint = complaint_of_reading(patched(bytes, "$Elements\n11\n", 4, size));
    EXPECT_EQ(complaint.place, place_after(bytes, "$Elements\n11\n", 4));
    EXPECT_EQ(complaint.expected, "a block of 1 to 11 elements");
    EXPECT_EQ(complaint.found, std::to_string(size));
  }
}

TEST_F(ReadMsh, RefusesABinaryDuplicateNodeOf22) {
  const std::string bytes = test::to_msh_22_binary(test::sample_mesh(1));
  const Complaint complaint = complaint_of_reading(patched(bytes, "$Nodes\n8\n", 28, std::int32_t{1000}));
  EXPECT_EQ(complaint.place, place_after(bytes, "$Nodes\n8\n", 28));
  EXPECT_EQ(complaint.found, "node 1000 a second time");
}

TEST_F(ReadMsh, RefusesABinarySecondOrderMesh) {
  ByteWriter out;
  out.text("$MeshFormat\n2.2 1 8\n").integer(1).text("\n$EndMeshFormat\n$Nodes\n1\n");
  out.integer(1).real(0).real(0).real(0).text("\n$EndNodes\n$Elements\n1\n").integer(11).integer(1).integer(0);
  const std::string bytes = out.text("\n$EndElements\n").bytes();
  const Complaint complaint = complaint_of_reading(bytes);
  EXPECT_EQ(complaint.place, place_after(bytes, "$Elements\n1\n", 0));
  EXPECT_EQ(complaint.expected, "tetrahedra of first order (element type 4)");
}

}  // namespace msh_reader_test
}  // namespace exmat::precompute
