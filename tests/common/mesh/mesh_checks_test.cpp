#include <functional>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <limits>
#include <numeric>

#include "common/core/error.h"
#include "common/mesh/checks.h"
#include "common/mesh/geometry.h"
#include "tests/support/box_mesh.h"

namespace exmat {
namespace {

using test::cube_grid;
using testing::ElementsAre;
using testing::HasSubstr;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr MeshCheckOptions kDropAll{true, true, true};

Complaint complaint_of(TetMesh mesh, const MeshCheckOptions& options = {}) {
  try {
    check_mesh(mesh, "body.veg", options);
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr("body.veg"));
    return error.complaint();
  }
  ADD_FAILURE() << "no InputError";
  return {};
}

void append_vertex(TetMesh& mesh, double x, double y, double z) {
  mesh.vertices.conservativeResize(mesh.vertex_count() + 1, 3);
  mesh.vertices.bottomRows(1) << x, y, z;
}

void append_tet(TetMesh& mesh, int a, int b, int c, int d) {
  mesh.tets.conservativeResize(mesh.tet_count() + 1, 4);
  mesh.tets.bottomRows(1) << a, b, c, d;
}

/// A unit cube and a tet with vertices of its own beside it.
TetMesh cube_and_tet() {
  TetMesh mesh = cube_grid(1);
  append_vertex(mesh, 3, 0, 0);
  append_vertex(mesh, 4, 0, 0);
  append_vertex(mesh, 3, 1, 0);
  append_vertex(mesh, 3, 0, 1);
  append_tet(mesh, 8, 9, 10, 11);
  return mesh;
}

/// The same tets, each with vertices of its own.
TetMesh exploded(const TetMesh& mesh) {
  TetMesh result{VertexArray(4 * mesh.tet_count(), 3), TetArray(mesh.tet_count(), 4)};
  for (Eigen::Index t = 0; t < mesh.tet_count(); ++t)
    for (int corner = 0; corner < 4; ++corner) {
      result.tets(t, corner) = static_cast<std::int32_t>(4 * t + corner);
      result.vertices.row(4 * t + corner) = mesh.vertices.row(mesh.tets(t, corner));
    }
  return result;
}

// Dropping all but the largest component would leave one tet.
TEST(CheckMesh, AdvisesToMergeVerticesAtOnePlace) {
  const TetMesh cube = cube_grid(2);
  const Complaint complaint = complaint_of(exploded(cube));
  EXPECT_EQ(complaint.found,
            "48 components, and " + std::to_string(4 * 48 - 27) + " vertices at places where another one is");
  EXPECT_THAT(complaint.advice, HasSubstr("merge"));
  EXPECT_THAT(complaint.advice, testing::Not(HasSubstr("drop")));
}

TEST(CheckMesh, LeavesASoundMeshAlone) {
  TetMesh mesh = cube_grid(2);
  const TetMesh before = mesh;
  const MeshReport report = check_mesh(mesh, "body.veg", {});
  EXPECT_EQ(mesh.vertices, before.vertices);
  EXPECT_EQ(mesh.tets, before.tets);
  EXPECT_EQ(report.reoriented_tets, 0);
  EXPECT_EQ(report.dropped_degenerate_tets, 0);
  EXPECT_EQ(report.dropped_vertices, 0);
  EXPECT_EQ(report.dropped_components, 0);
  std::vector<std::int32_t> identity(static_cast<std::size_t>(mesh.vertex_count()));
  std::iota(identity.begin(), identity.end(), 0);
  EXPECT_EQ(report.kept_vertices, identity);
  identity.resize(48);
  std::iota(identity.begin(), identity.end(), 0);
  EXPECT_EQ(report.kept_tets, identity);
}

TEST(CheckMesh, ReorientsInvertedTets) {
  TetMesh mesh = cube_grid(2);
  for (const int tet : {3, 17, 40}) std::swap(mesh.tets(tet, 0), mesh.tets(tet, 1));
  EXPECT_EQ(check_mesh(mesh, "body.veg", {}).reoriented_tets, 3);
  EXPECT_GT(tet_volumes(mesh).minCoeff(), 0.0);
  EXPECT_EQ(check_mesh(mesh, "body.veg", {}).reoriented_tets, 0);
}

TEST(CheckMesh, RefusesAnEmptyMesh) {
  EXPECT_EQ(complaint_of(TetMesh{}).expected, "vertices");
  TetMesh mesh = cube_grid(1);
  mesh.tets.resize(0, 4);
  EXPECT_EQ(complaint_of(mesh).expected, "tetrahedra");
}

TEST(CheckMesh, RefusesCoordinatesThatAreNotFinite) {
  TetMesh mesh = cube_grid(1);
  mesh.vertices(5, 1) = std::numeric_limits<double>::infinity();
  mesh.vertices(4, 2) = kNan;
  const Complaint complaint = complaint_of(mesh);
  EXPECT_EQ(complaint.place, "vertex 5 (1-based, 2 such vertices)");
  EXPECT_EQ(complaint.expected, "finite coordinates");
  EXPECT_EQ(complaint.found, "(0, 0, nan)");
}

TEST(CheckMesh, RefusesCornersOutOfRange) {
  for (const int corner : {-1, 8, std::numeric_limits<int>::max(), std::numeric_limits<int>::min()}) {
    TetMesh mesh = cube_grid(1);
    mesh.tets(2, 3) = corner;
    const Complaint complaint = complaint_of(mesh, kDropAll);
    EXPECT_EQ(complaint.place, "tet 3 (1-based, 1 such tet)");
    EXPECT_EQ(complaint.expected, "corners from 1 to 8 (1-based)");
    EXPECT_THAT(complaint.found, HasSubstr(std::to_string(std::int64_t{corner} + 1)));
  }
}

TEST(CheckMesh, NamesNanBeforeRangesBeforeDegenerateTets) {
  TetMesh mesh = cube_grid(1);
  mesh.tets(0, 0) = mesh.tets(0, 1);
  EXPECT_EQ(complaint_of(mesh).expected, "four distinct corners");
  mesh.tets(1, 0) = 99;
  EXPECT_THAT(complaint_of(mesh).expected, HasSubstr("corners from 1"));
  mesh.vertices(0, 0) = kNan;
  EXPECT_EQ(complaint_of(mesh).expected, "finite coordinates");
}

TEST(CheckMesh, RefusesOrDropsRepeatedCorners) {
  TetMesh mesh = cube_grid(1);
  append_tet(mesh, 1, 2, 1, 4);
  const Complaint complaint = complaint_of(mesh);
  EXPECT_EQ(complaint.place, "tet 7 (1-based, 1 such tet)");
  EXPECT_EQ(complaint.found, "2, 3, 2, 5 (1-based)");
  EXPECT_THAT(complaint.advice, HasSubstr(R"("drop": ["degenerate_tets"])"));
  const MeshReport report = check_mesh(mesh, "body.veg", {.drop_degenerate_tets = true});
  EXPECT_EQ(report.dropped_degenerate_tets, 1);
  EXPECT_EQ(mesh.tet_count(), 6);
}

TEST(CheckMesh, RefusesOrDropsFlatTets) {
  TetMesh mesh = cube_grid(2);
  append_tet(mesh, 0, 1, 3, 4);
  append_tet(mesh, 0, 3, 6, 9);
  const Complaint complaint = complaint_of(mesh);
  EXPECT_EQ(complaint.place, "tet 49 (1-based, 2 such tets)");
  EXPECT_THAT(complaint.expected, HasSubstr("a volume above 2.82843e-12"));
  EXPECT_EQ(complaint.found, "0");
  const MeshReport report = check_mesh(mesh, "body.veg", {.drop_degenerate_tets = true});
  EXPECT_EQ(report.dropped_degenerate_tets, 2);
  EXPECT_EQ(report.kept_tets.size(), 48U);
  EXPECT_EQ(report.dropped_vertices, 0);
}

TEST(CheckMesh, MapsKeptTetsToTheFile) {
  TetMesh mesh = cube_grid(1);
  const TetMesh whole = mesh;
  mesh.tets.row(2).setConstant(1);
  const MeshReport report = check_mesh(mesh, "body.veg", {.drop_degenerate_tets = true});
  EXPECT_THAT(report.kept_tets, ElementsAre(0, 1, 3, 4, 5));
  EXPECT_EQ(mesh.tets.row(2), whole.tets.row(3));
}

TEST(CheckMesh, DropsTheVerticesThatOnlyDegenerateTetsUse) {
  TetMesh mesh = cube_grid(1);
  append_vertex(mesh, 2, 0, 0);
  append_tet(mesh, 0, 1, 8, 8);
  const MeshReport report = check_mesh(mesh, "body.veg", {.drop_degenerate_tets = true});
  EXPECT_EQ(report.dropped_vertices, 1);
  EXPECT_EQ(mesh.vertex_count(), 8);
}

TEST(CheckMesh, RefusesWhereAllTetsAreDegenerate) {
  TetMesh mesh = cube_grid(1);
  mesh.vertices.col(2).setZero();
  EXPECT_EQ(complaint_of(mesh, kDropAll).expected, "tets that are not degenerate");
}

TEST(CheckMesh, JudgesVolumesRelativeToEdges) {
  for (const double edge : {1e-30, 1e-6, 1.0, 1e6, 1e60}) {
    TetMesh mesh = cube_grid(2, edge);
    EXPECT_NO_THROW(check_mesh(mesh, "body.veg", {})) << edge;
  }
  const auto sliver = [](double height) {
    TetMesh mesh = cube_grid(1);
    mesh.vertices.resize(4, 3);
    mesh.vertices << 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, height;
    mesh.tets.resize(1, 4);
    mesh.tets << 0, 1, 2, 3;
    return mesh;
  };
  // Volume height / 6, longest edge sqrt(2).
  const double height = 6e-12 * std::pow(2.0, 1.5);
  TetMesh sound = sliver(1.001 * height);
  EXPECT_NO_THROW(check_mesh(sound, "body.veg", {}));
  EXPECT_THAT(complaint_of(sliver(0.999 * height)).expected, HasSubstr("a volume above"));
}

TEST(CheckMesh, RefusesVolumesThatOverflow) {
  EXPECT_THAT(complaint_of(cube_grid(1, 1e120)).expected, HasSubstr("to 1e100 m"));
}

TEST(CheckMesh, RefusesRepeatedTets) {
  TetMesh mesh = cube_grid(1);
  append_tet(mesh, mesh.tets(4, 1), mesh.tets(4, 0), mesh.tets(4, 3), mesh.tets(4, 2));
  append_tet(mesh, mesh.tets(1, 0), mesh.tets(1, 1), mesh.tets(1, 2), mesh.tets(1, 3));
  const Complaint complaint = complaint_of(mesh, kDropAll);
  EXPECT_EQ(complaint.place, "tet 7 (1-based, 2 such tets)");
  EXPECT_EQ(complaint.found, "those of tet 5");
}

TEST(CheckMesh, NamesRepeatedTetsAsTheFileNumbersThem) {
  TetMesh mesh = cube_grid(1);
  mesh.tets.row(0).setConstant(1);
  append_tet(mesh, mesh.tets(4, 0), mesh.tets(4, 1), mesh.tets(4, 2), mesh.tets(4, 3));
  const Complaint complaint = complaint_of(mesh, {.drop_degenerate_tets = true});
  EXPECT_EQ(complaint.place, "tet 7 (1-based, 1 such tet)");
  EXPECT_EQ(complaint.found, "those of tet 5");
}

TEST(CheckMesh, RefusesOrDropsUnreferencedVertices) {
  TetMesh mesh = cube_grid(1);
  VertexArray vertices(10, 3);
  vertices << Eigen::RowVector3d(9, 9, 9), mesh.vertices, Eigen::RowVector3d(7, 7, 7);
  mesh.vertices = vertices;
  mesh.tets.array() += 1;
  const Complaint complaint = complaint_of(mesh);
  EXPECT_EQ(complaint.place, "vertex 1 (1-based, 2 such vertices)");
  EXPECT_THAT(complaint.advice, HasSubstr(R"("drop": ["unreferenced_vertices"])"));
  const MeshReport report = check_mesh(mesh, "body.veg", {.drop_unreferenced_vertices = true});
  EXPECT_EQ(report.dropped_vertices, 2);
  EXPECT_THAT(report.kept_vertices, ElementsAre(1, 2, 3, 4, 5, 6, 7, 8));
  EXPECT_EQ(mesh.vertices, cube_grid(1).vertices);
  EXPECT_EQ(mesh.tets, cube_grid(1).tets);
}

TEST(CheckMesh, RefusesOrDropsSmallerComponents) {
  TetMesh mesh = cube_and_tet();
  const Complaint complaint = complaint_of(mesh);
  EXPECT_EQ(complaint.place, "tet 7 (1-based, 1 such tet)");
  EXPECT_EQ(complaint.found, "2 components");
  EXPECT_THAT(complaint.advice, HasSubstr(R"("drop": ["smaller_components"])"));
  EXPECT_THAT(complaint.advice, HasSubstr("only in an edge or a vertex"));
  const MeshReport report = check_mesh(mesh, "body.veg", {.drop_smaller_components = true});
  EXPECT_EQ(report.dropped_components, 1);
  EXPECT_EQ(report.dropped_vertices, 4);
  EXPECT_EQ(mesh.tets, cube_grid(1).tets);
  EXPECT_EQ(mesh.vertices, cube_grid(1).vertices);
}

TEST(CheckMesh, KeepsTheComponentOfTheLargestVolume) {
  TetMesh mesh = cube_and_tet();
  mesh.vertices.bottomRows(4) *= 10;
  const MeshReport report = check_mesh(mesh, "body.veg", {.drop_smaller_components = true});
  EXPECT_THAT(report.kept_tets, ElementsAre(6));
  EXPECT_THAT(report.kept_vertices, ElementsAre(8, 9, 10, 11));
}

TEST(CheckMesh, CountsTetsThatTouchInAnEdgeOrAVertexAsComponents) {
  TetMesh edge = cube_grid(1);
  append_vertex(edge, 2, -1, 0);
  append_vertex(edge, 2, 0, 0.5);
  append_tet(edge, 1, 5, 8, 9);
  EXPECT_EQ(complaint_of(edge).found, "2 components");
  TetMesh corner = cube_grid(1);
  append_vertex(corner, 2, 1, 1);
  append_vertex(corner, 2, 2, 1);
  append_vertex(corner, 2, 1, 2);
  append_tet(corner, 7, 8, 9, 10);
  EXPECT_EQ(complaint_of(corner).found, "2 components");
  const MeshReport report = check_mesh(corner, "body.veg", {.drop_smaller_components = true});
  EXPECT_EQ(report.dropped_vertices, 3);
}

TEST(CheckMesh, MendsSeveralFaultsAtOnce) {
  TetMesh mesh = cube_and_tet();
  append_vertex(mesh, 9, 9, 9);
  append_tet(mesh, 0, 1, 1, 2);
  std::swap(mesh.tets(0, 0), mesh.tets(0, 1));
  const MeshReport report = check_mesh(mesh, "body.veg", kDropAll);
  EXPECT_EQ(report.dropped_degenerate_tets, 1);
  EXPECT_EQ(report.dropped_components, 1);
  EXPECT_EQ(report.dropped_vertices, 5);
  EXPECT_EQ(report.reoriented_tets, 1);
  EXPECT_EQ(mesh.vertex_count(), 8);
  EXPECT_NEAR(tet_volumes(mesh).sum(), 1.0, 1e-14);
  EXPECT_NO_THROW(check_mesh(mesh, "body.veg", {}));
}

TEST(CheckMesh, HandlesAMeshOfManyTets) {
  TetMesh mesh = cube_grid(24, 0.1);
  EXPECT_EQ(check_mesh(mesh, "body.veg", {}).kept_tets.size(), 6U * 24 * 24 * 24);
}

}  // namespace
}  // namespace exmat
