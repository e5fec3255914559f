#include "common/surface_io/polygon_faces.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <numbers>
#include <numeric>

#include "common/core/error.h"
#include "common/surface_io/obj_reader.h"
#include "common/surface_io/ply_reader.h"
#include "tests/support/random.h"
#include "tests/support/temporary_folder.h"

namespace exmat {
namespace {

using Point = Eigen::Vector2d;
using Corners = std::vector<std::array<double, 3>>;

/// Area of a polygon in the plane z = 0: half the sum of its edges' cross products (Gauss's area formula).
double area_of(const std::vector<Point>& points) {
  double twice = 0;
  for (std::size_t k = 0; k < points.size(); ++k) {
    const Point &a = points[k], &b = points[(k + 1) % points.size()];
    twice += a[0] * b[1] - a[1] * b[0];
  }
  return 0.5 * twice;
}

/// Every triangle looks to the polygon's side, and their areas add up to the polygon's: they cover it, once.
void expect_covered(const std::vector<Point>& points, const Eigen::Matrix3d& turn = Eigen::Matrix3d::Identity()) {
  Corners corners;
  for (const Point& p : points) {
    const Eigen::Vector3d x = turn * Eigen::Vector3d(p[0], p[1], 0) + Eigen::Vector3d(3, -2, 7);
    corners.push_back({x[0], x[1], x[2]});
  }
  std::vector<std::int32_t> polygon(points.size());
  std::iota(polygon.begin(), polygon.end(), 0);
  PolygonFaces faces;
  faces.add(polygon);
  faces.cut_ears(corners, "a.obj");
  ASSERT_EQ(faces.triangles().size(), points.size() - 2);
  double sum = 0;
  for (const auto& [a, b, c] : faces.triangles()) {
    const double area = area_of({points[static_cast<std::size_t>(a)], points[static_cast<std::size_t>(b)],
                                 points[static_cast<std::size_t>(c)]});
    EXPECT_GT(area, 0);
    sum += area;
  }
  EXPECT_NEAR(sum, area_of(points), 1e-12 * area_of(points));
}

/// From each of its corners on.
void expect_covered_from_any(std::vector<Point> points) {
  const Eigen::Matrix3d turn = Eigen::AngleAxisd(1.1, Eigen::Vector3d(1, 2, -3).normalized()).toRotationMatrix();
  for (std::size_t k = 0; k < points.size(); ++k) {
    expect_covered(points, turn);
    std::rotate(points.begin(), points.begin() + 1, points.end());
  }
}

const std::vector<Point> kLetterC{{0, 0}, {3, 0}, {3, 1}, {1, 1}, {1, 2}, {3, 2}, {3, 3}, {0, 3}};

TEST(PolygonFaces, CoverConcaveFaces) {
  expect_covered_from_any(kLetterC);
  expect_covered_from_any({{0, 0}, {4, 0}, {1, 1}, {0, 4}});                                          // an arrow head
  expect_covered_from_any({{0, 0}, {6, 0}, {6, 4}, {5, 1}, {4, 4}, {3, 1}, {2, 4}, {1, 1}, {0, 4}});  // a comb
  std::vector<Point> star;
  for (int k = 0; k < 24; ++k)
    star.push_back((k % 2 == 0 ? 3.0 : 0.5) *
                   Point(std::cos(k * std::numbers::pi / 12), std::sin(k * std::numbers::pi / 12)));
  expect_covered_from_any(star);
  std::vector<Point> spiral;
  for (int k = 0; k <= 60; ++k) spiral.push_back((1 + 0.1 * k) * Point(std::cos(0.3 * k), std::sin(0.3 * k)));
  for (int k = 60; k >= 0; --k) spiral.push_back((1.5 + 0.1 * k) * Point(std::cos(0.3 * k), std::sin(0.3 * k)));
  std::ranges::reverse(spiral);
  expect_covered_from_any(spiral);
}

TEST(PolygonFaces, CoverFacesWithCornersOnTheirEdges) {
  expect_covered_from_any({{0, 0}, {1, 0}, {2, 0}, {2, 2}, {0, 2}, {0, 1}});
}

TEST(PolygonFaces, ConvexFacesAreFansOfTheirFirstCorner) {
  PolygonFaces faces;
  faces.add({0, 1, 2, 3, 4});
  faces.cut_ears({{0, 0, 0}, {2, 0, 0}, {3, 2, 0.01}, {1, 3, 0}, {-1, 2, -0.01}}, "a.obj");
  EXPECT_THAT(faces.triangles(),
              testing::ElementsAre(std::array<std::int32_t, 3>{0, 1, 2}, std::array<std::int32_t, 3>{0, 2, 3},
                                   std::array<std::int32_t, 3>{0, 3, 4}));
}

/// Crossing, flat, of one place, too far: as many triangles, whatever they are.
TEST(PolygonFaces, EndWithFacesThatAreNone) {
  const double far = 1e308;
  for (const Corners& corners :
       {Corners{{0, 0, 0}, {1, 1, 0}, {1, 0, 0}, {0, 1, 0}}, Corners{{0, 0, 0}, {1, 0, 0}, {3, 0, 0}, {2, 0, 0}},
        Corners(5, {1, 2, 3}), Corners{{-far, 0, 0}, {far, 0, 0}, {far, far, 0}, {0, -far, far}}}) {
    PolygonFaces faces;
    std::vector<std::int32_t> polygon(corners.size());
    std::iota(polygon.begin(), polygon.end(), 0);
    faces.add(polygon);
    faces.cut_ears(corners, "a.obj");
    EXPECT_EQ(faces.triangles().size(), corners.size() - 2);
  }
}

TEST(PolygonFaces, WarnOfFacesThatCrossThemselves) {
  const auto warnings = [](const Corners& corners) {
    PolygonFaces faces;
    std::vector<std::int32_t> polygon(corners.size());
    std::iota(polygon.begin(), polygon.end(), 0);
    faces.add(polygon);
    return faces.cut_ears(corners, "a.obj");
  };
  Corners star;
  for (int k = 0; k < 5; ++k)
    star.push_back({std::cos(0.8 * std::numbers::pi * k), std::sin(0.8 * std::numbers::pi * k), 0});
  for (const Corners& corners : {Corners{{0, 0, 0}, {1, 1, 0}, {1, 0, 0}, {0, 1, 0}},  // of loops that cancel
                                 Corners{{0, 0, 0}, {3, 0, 1}, {1, 1, 0}, {2, 1, 1}}, star})
    EXPECT_THAT(warnings(corners), testing::ElementsAre(testing::HasSubstr("1 face whose edges cross is cut into")));
  for (const Corners& corners :
       {Corners{{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}}, Corners{{0, 0, 0}, {4, 0, 0}, {1, 1, 0}, {0, 4, 0}},
        Corners(5, {1, 2, 3}), Corners{{0, 0, 0}, {1, 0, 0}, {3, 0, 0}, {2, 0, 0}}})
    EXPECT_THAT(warnings(corners), testing::IsEmpty());
}

TEST(PolygonFaces, CoverLargeConcaveFaces) {
  std::vector<Point> points;
  for (int k = 0; k < 3000; ++k) points.emplace_back(std::cos(k * 1e-3), std::sin(k * 1e-3));
  for (int k = 2999; k >= 0; --k) points.emplace_back(0.5 * std::cos(k * 1e-3), 0.5 * std::sin(k * 1e-3));
  expect_covered(points);
}

TEST(PolygonFaces, RefuseThousandsOfCornersAtRandom) {
  const Eigen::MatrixXd places = test::random_matrix(5000, 3, 1);
  Corners corners;
  std::vector<std::int32_t> polygon;
  for (const auto& x : places.rowwise()) {
    polygon.push_back(static_cast<std::int32_t>(corners.size()));
    corners.push_back({x[0], x[1], x[2]});
  }
  PolygonFaces faces;
  faces.add(polygon);
  try {
    faces.cut_ears(corners, "a.obj");
    FAIL();
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr("export the mesh triangulated"));
  }
}

/// A prism over the letter C: the area of C times the height, by any first corner of its faces.
TEST(PolygonFaces, AreReadOfFilesAsSolids) {
  const test::TemporaryFolder folder;
  const auto volume = [](const SurfaceMesh& mesh) {
    double sum = 0;
    for (const auto& t : mesh.triangles.rowwise()) {
      const Eigen::Vector3d a = mesh.vertices.row(t[0]), b = mesh.vertices.row(t[1]), c = mesh.vertices.row(t[2]);
      sum += a.dot(b.cross(c)) / 6;
    }
    return sum;
  };
  // A fan of convex pieces of a concave face has the right signed volume too, so each triangle's side is asked for.
  const auto faces_up = [](const SurfaceMesh& mesh) {
    for (const auto& t : mesh.triangles.rowwise()) {
      const Eigen::Vector3d a = mesh.vertices.row(t[0]), b = mesh.vertices.row(t[1]), c = mesh.vertices.row(t[2]);
      if (a[2] != b[2] || b[2] != c[2]) continue;
      EXPECT_GT((b - a).cross(c - a)[2] * (a[2] > 0 ? 1 : -1), 0);
    }
  };
  const std::size_t n = kLetterC.size();
  for (std::size_t first = 0; first < n; ++first) {
    std::string obj, vertices, faces;
    const auto add_face = [&](const std::vector<std::size_t>& corners) {
      obj += "f";
      faces += std::to_string(corners.size());
      for (const std::size_t corner : corners) {
        obj += " " + std::to_string(corner + 1);
        faces += " " + std::to_string(corner);
      }
      obj += "\n";
      faces += "\n";
    };
    std::vector<std::size_t> top, bottom;
    for (std::size_t k = 0; k < n; ++k) {
      top.push_back(n + (first + k) % n);
      bottom.push_back((first + n - k) % n);
    }
    add_face(top);
    add_face(bottom);
    for (std::size_t k = 0; k < n; ++k) add_face({k, (k + 1) % n, n + (k + 1) % n, n + k});
    for (const double z : {0.0, 1.5})
      for (const Point& p : kLetterC)
        vertices += std::to_string(p[0]) + " " + std::to_string(p[1]) + " " + std::to_string(z) + "\n";
    std::string prefixed;
    for (std::size_t at = 0; at < vertices.size();) {
      const std::size_t end = vertices.find('\n', at) + 1;
      prefixed += "v " + vertices.substr(at, end - at);
      at = end;
    }
    const std::string ply =
        "ply\nformat ascii 1.0\nelement vertex 16\nproperty double x\nproperty double y\nproperty double z\n"
        "element face 10\nproperty list uchar int vertex_indices\nend_header\n" +
        vertices + faces;
    // Vertices may follow the faces.
    for (const SurfaceMesh& mesh :
         {read_obj(folder.write("c.obj", prefixed + obj)).mesh, read_obj(folder.write("d.obj", obj + prefixed)).mesh,
          read_ply(folder.write("c.ply", ply)).mesh}) {
      EXPECT_NEAR(volume(mesh), 7 * 1.5, 1e-12);
      EXPECT_EQ(mesh.triangles.rows(), 2 * 6 + 16);
      faces_up(mesh);
    }
  }
}

}  // namespace
}  // namespace exmat
