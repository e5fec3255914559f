#include "precompute/mesh_io/vertex_selection.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/precompute/mesh_io/mesh_samples.h"
#include "tests/support/box_mesh.h"

namespace exmat::precompute {
namespace {

using test::complaint_of;
using test::TemporaryFolder;
using testing::ElementsAre;
using testing::HasSubstr;

/// Corners of the unit cube: vertex i is (i & 1, i >> 1 & 1, i >> 2 & 1).
const VertexArray& cube() {
  static const VertexArray kVertices = exmat::test::cube_grid(1).vertices;
  return kVertices;
}

std::vector<std::int32_t> select(const VertexSelection& selection) {
  return select_vertices(cube(), selection, "asset.json");
}

Complaint complaint_of_selecting(const VertexSelection& selection) {
  return complaint_of([&] { select(selection); });
}

TEST(SelectVertices, InABoxIncludesItsBounds) {
  EXPECT_THAT(select(BoxSelection{{0, 0, 0}, {1, 1, 0}}), ElementsAre(0, 1, 2, 3));
  EXPECT_THAT(select(BoxSelection{{1, 1, 1}, {1, 1, 1}}), ElementsAre(7));
  EXPECT_THAT(select(BoxSelection{{-1, -1, 0.5}, {2, 2, 2}}), ElementsAre(4, 5, 6, 7));
}

TEST(SelectVertices, InASphereIncludesItsSurface) {
  EXPECT_THAT(select(SphereSelection{{0, 0, 0}, 1}), ElementsAre(0, 1, 2, 4));
  EXPECT_THAT(select(SphereSelection{{0, 0, 0}, 0}), ElementsAre(0));
}

TEST(SelectVertices, ByIdsSortsThemAndCollapsesRepeats) {
  EXPECT_THAT(select(IdSelection{{7, 0, 3, 0, 7}}), ElementsAre(0, 3, 7));
}

TEST(SelectVertices, ByAFileTakesCommasBlanksLinesAndComments) {
  const TemporaryFolder folder;
  const auto file = folder.write("left.bou", "# fixed\n8, 1,2\n\n 3\t4 # 5\n,\r\n");
  EXPECT_THAT(select(FileSelection{file}), ElementsAre(0, 1, 2, 3, 7));
}

TEST(SelectVertices, RefusesIdsThatAreNoVertices) {
  for (const std::int64_t id : {std::int64_t{-1}, std::int64_t{8}, std::int64_t{1} << 40}) {
    const Complaint complaint = complaint_of_selecting(IdSelection{{0, id}});
    EXPECT_EQ(complaint.file, "asset.json");
    EXPECT_EQ(complaint.place, "ids");
    EXPECT_EQ(complaint.expected, "0-based vertex ids below 8");
    EXPECT_EQ(complaint.found, std::to_string(id));
  }
}

TEST(SelectVertices, RefusesLinesOfAFileThatAreNoVertices) {
  const TemporaryFolder folder;
  for (const std::string field : {"0", "9", "-1", "1.5", "two", "99999999999999999999"}) {
    const auto file = folder.write("ids.txt", "1\n2, " + field + "\n");
    const Complaint complaint = complaint_of_selecting(FileSelection{file});
    EXPECT_EQ(complaint.file, file.string());
    EXPECT_EQ(complaint.place, "line 2");
    EXPECT_EQ(complaint.expected, "vertex ids from 1 to 8");
    EXPECT_EQ(complaint.found, "\"" + field + "\"");
  }
}

TEST(SelectVertices, RefusesAMissingAndAnEmptyFile) {
  EXPECT_THROW(select(FileSelection{"nowhere/ids.txt"}), InputError);
  const TemporaryFolder folder;
  const Complaint complaint = complaint_of_selecting(FileSelection{folder.write("ids.txt", "# none yet\n")});
  EXPECT_EQ(complaint.expected, "vertex ids >= 1");
  EXPECT_EQ(complaint.found, "none");
}

TEST(SelectVertices, RefusesAnEmptySelectionAndGivesTheBoundingBox) {
  const std::vector<VertexSelection> selections{BoxSelection{{2, 2, 2}, {3, 3, 3}}, BoxSelection{{1, 1, 1}, {0, 0, 0}},
                                                SphereSelection{{0.5, 0.5, 0.5}, 0.5}, IdSelection{}};
  for (const auto& selection : selections) {
    const Complaint complaint = complaint_of_selecting(selection);
    EXPECT_EQ(complaint.expected, "at least one vertex of the mesh");
    EXPECT_EQ(complaint.advice, "the mesh lies in (0, 0, 0) to (1, 1, 1)");
  }
  EXPECT_EQ(complaint_of_selecting(selections[0]).place, "the box (2, 2, 2) to (3, 3, 3)");
  EXPECT_EQ(complaint_of_selecting(selections[2]).place, "the sphere about (0.5, 0.5, 0.5) of radius 0.5");
}

TEST(SelectTets, ByCentroidIdOrSet) {
  const TetMesh mesh = exmat::test::box_mesh({2, 1, 1}, {2, 1, 1});
  const TetSets sets{{"part", {3, 1}}, {"nothing", {}}};
  const auto select = [&](const TetSelection& selection) { return select_tets(mesh, sets, selection, "asset.json"); };
  EXPECT_THAT(select(BoxSelection{{1, 0, 0}, {2, 1, 1}}), ElementsAre(6, 7, 8, 9, 10, 11));
  EXPECT_THAT(select(SphereSelection{{0.5, 0.5, 0.5}, 0.6}), ElementsAre(0, 1, 2, 3, 4, 5));
  EXPECT_THAT(select(IdSelection{{7, 1}}), ElementsAre(1, 7));
  EXPECT_THAT(select(SetSelection{"part"}), ElementsAre(1, 3));
  const TemporaryFolder folder;
  EXPECT_THAT(select(FileSelection{folder.write("a.txt", "1, 12\n")}), ElementsAre(0, 11));
  const auto found = [&](const TetSelection& selection) { return complaint_of([&] { select(selection); }); };
  EXPECT_THAT(found(IdSelection{{12}}).expected, HasSubstr("0-based tet ids below 12"));
  EXPECT_THAT(found(FileSelection{folder.write("b.txt", "13\n")}).expected, HasSubstr("tet ids from 1 to 12"));
  EXPECT_THAT(found(BoxSelection{{5, 0, 0}, {6, 1, 1}}).expected, HasSubstr("at least one tet of the mesh"));
  EXPECT_THAT(found(SetSelection{"nothing"}).expected, HasSubstr("at least one tet of the mesh"));
  EXPECT_THAT(found(SetSelection{"parts"}).advice, HasSubstr("\"nothing\", \"part\""));
}

}  // namespace
}  // namespace exmat::precompute
