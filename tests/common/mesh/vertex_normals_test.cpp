#include "common/mesh/vertex_normals.h"

#include <Eigen/Geometry>
#include <cmath>
#include <gtest/gtest.h>
#include <numbers>
#include <utility>

namespace exmat {
namespace {

struct Mesh {
  VertexArray vertices;
  TriangleArray triangles;
};

/// A unit sphere by latitude and longitude, with the seam of a texture: its first meridian twice, its poles once for
/// each longitude.
Mesh sphere(int rings, int sectors) {
  Mesh mesh{VertexArray((rings + 1) * (sectors + 1), 3), TriangleArray(2 * rings * sectors, 3)};
  for (int i = 0; i <= rings; ++i)
    for (int j = 0; j <= sectors; ++j) {
      const double theta = std::numbers::pi * i / rings, phi = 2 * std::numbers::pi * (j % sectors) / sectors;
      const double radius = i == 0 || i == rings ? 0 : std::sin(theta);
      mesh.vertices.row(i * (sectors + 1) + j) << radius * std::cos(phi), radius * std::sin(phi), std::cos(theta);
    }
  Eigen::Index row = 0;
  for (int i = 0; i < rings; ++i)
    for (int j = 0; j < sectors; ++j) {
      const int a = i * (sectors + 1) + j, b = a + sectors + 1;
      mesh.triangles.row(row++) << a, b, b + 1;
      mesh.triangles.row(row++) << a, b + 1, a + 1;
    }
  return mesh;
}

double worst_angle(const VertexArray& normals, const VertexArray& expected) {
  double worst = 0;
  for (Eigen::Index k = 0; k < normals.rows(); ++k) {
    const Eigen::Vector3d a = normals.row(k), b = expected.row(k);
    worst = std::max(worst, std::atan2(a.cross(b).norm(), a.dot(b)));
  }
  return worst;
}

TEST(VertexNormals, OfASphereAreItsRadii) {
  for (const int rings : {16, 32, 64}) {
    const Mesh mesh = sphere(rings, 2 * rings);
    const double step = std::numbers::pi / rings;  // of first order in it beside the poles
    EXPECT_LT(worst_angle(VertexNormals(mesh.vertices, mesh.triangles).at(mesh.vertices), mesh.vertices), 0.2 * step);
  }
}

/// Two squares that meet in an edge of 45 degrees, which each of them has for itself.
Mesh roof() {
  Mesh mesh{VertexArray(8, 3), TriangleArray(4, 3)};
  mesh.vertices << 0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0, 1, 0, 0, 2, 0, -1, 2, 1, -1, 1, 1, 0;
  mesh.triangles << 0, 1, 2, 0, 2, 3, 4, 5, 6, 4, 6, 7;
  return mesh;
}

TEST(VertexNormals, AreThoseOfASmoothEdgeUnlessAnArtistsDiffer) {
  const Mesh mesh = roof();
  const Eigen::RowVector3d flat(0, 0, 1), slope = Eigen::RowVector3d(1, 0, 1).normalized();
  const VertexArray shared = VertexNormals(mesh.vertices, mesh.triangles).at(mesh.vertices);
  EXPECT_LT((shared.row(1) - shared.row(4)).norm(), 1e-15);
  VertexArray given(8, 3);
  given << flat, flat, flat, flat, slope, slope, slope, slope;
  const VertexArray own = VertexNormals(mesh.vertices, mesh.triangles, given).at(mesh.vertices);
  EXPECT_LT((own - given).norm(), 1e-14);
  // Those that an artist made equal are shared across any edge.
  given.rowwise() = slope;
  VertexArray folded = mesh.vertices;
  folded(5, 2) = folded(6, 2) = -9;
  folded(5, 0) = folded(6, 0) = 1;
  const VertexArray smooth = VertexNormals(folded, mesh.triangles, given).at(folded);
  EXPECT_LT((smooth.row(1) - smooth.row(4)).norm(), 1e-15);
}

TEST(VertexNormals, AreEqualAlongASeam) {
  const Mesh mesh = sphere(12, 20);
  const VertexNormals normals(mesh.vertices, mesh.triangles);
  // Also where the sphere has become an egg that leans over.
  VertexArray moved = mesh.vertices;
  for (auto point : moved.rowwise()) point << point[0] + 0.3 * point[2] * point[2], 1.7 * point[1], 0.6 * point[2];
  const VertexArray found = normals.at(moved);
  for (Eigen::Index ring = 0; ring <= 12; ++ring) EXPECT_EQ(found.row(21 * ring), found.row(21 * ring + 20)) << ring;
}

TEST(VertexNormals, StayApartAtHardEdges) {
  // Two squares at a right angle that share an edge in space but no vertex, and two at 30 degrees.
  for (const double degrees : {90.0, 30.0}) {
    const double angle = degrees * std::numbers::pi / 180;
    Mesh mesh{VertexArray(8, 3), TriangleArray(4, 3)};
    mesh.vertices << 0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0,  //
        1, 0, 0, 1 + std::cos(angle), 0, std::sin(angle), 1 + std::cos(angle), 1, std::sin(angle), 1, 1, 0;
    mesh.triangles << 0, 1, 2, 0, 2, 3, 4, 5, 6, 4, 6, 7;
    const VertexArray found = VertexNormals(mesh.vertices, mesh.triangles).at(mesh.vertices);
    EXPECT_EQ(found.row(1) == found.row(4), degrees < 60) << degrees;
    EXPECT_NEAR(found(0, 2), 1, 1e-15);
  }
}

TEST(VertexNormals, AreTheSameInSinglePrecision) {
  const Mesh mesh = sphere(12, 20);
  const VertexNormals normals(mesh.vertices, mesh.triangles);
  const Eigen::Matrix<float, Eigen::Dynamic, 3, Eigen::RowMajor> positions = mesh.vertices.cast<float>();
  Eigen::Matrix<float, Eigen::Dynamic, 3, Eigen::RowMajor> found(positions.rows(), 3);
  normals.read({positions.data(), static_cast<std::size_t>(positions.size())},
               {found.data(), static_cast<std::size_t>(found.size())});
  // Rounding of floats over the edge of a triangle beside a pole, 0.07 of the radius.
  EXPECT_LT((found.cast<double>() - normals.at(mesh.vertices)).cwiseAbs().maxCoeff(), 6e-8 / 0.07);
}

TEST(VertexNormals, OfAVertexWithoutTrianglesIsTheZAxis) {
  VertexArray vertices(4, 3);
  vertices << 0, 0, 0, 1, 0, 0, 0, 0, 1, 5, 5, 5;
  TriangleArray triangles(2, 3);
  triangles << 0, 1, 2, 3, 3, 3;
  const VertexNormals normals(vertices, std::move(triangles));
  EXPECT_EQ(normals.at(vertices).row(3), Eigen::RowVector3d::UnitZ());
  EXPECT_EQ(normals.at(vertices).row(0), -Eigen::RowVector3d::UnitY());
  EXPECT_TRUE(normals.derivatives(vertices, RowMatrix::Ones(12, 1)).isZero(0));
}

TEST(VertexNormals, HaveTheDerivativesOfCentralDifferences) {
  const Mesh mesh = sphere(8, 12);
  const VertexNormals normals(mesh.vertices, mesh.triangles);
  const RowMatrix displacements = RowMatrix::Random(mesh.vertices.size(), 2);
  const RowMatrix found = normals.derivatives(mesh.vertices, displacements);
  constexpr double kStep = 1e-5;  // third derivatives times its square: 1e-10, and rounding 1e-11
  for (Eigen::Index column = 0; column < 2; ++column) {
    VertexArray ahead = mesh.vertices, behind = mesh.vertices;
    ahead.reshaped<Eigen::RowMajor>() += kStep * displacements.col(column);
    behind.reshaped<Eigen::RowMajor>() -= kStep * displacements.col(column);
    // Displacements differ between vertices at one place, so that triangles open: sums are still shared.
    const VertexArray difference = (normals.at(ahead) - normals.at(behind)) / (2 * kStep);
    const double error = (found.col(column) - difference.reshaped<Eigen::RowMajor>()).cwiseAbs().maxCoeff();
    EXPECT_LT(error, 1e-6 * difference.cwiseAbs().maxCoeff());
  }
}

}  // namespace
}  // namespace exmat
