#include "common/mesh/surface_check.h"

#include <gtest/gtest.h>

#include "tests/support/surfaces.h"

namespace exmat {
namespace {

TEST(SurfaceCheck, FindsNothingInAClosedSurface) {
  const SurfaceMesh box = test::box_surface({2, 3, 1}, {1, 2, 3});
  EXPECT_FALSE(surface_faults(box.triangles).any());
  EXPECT_EQ(surface_faults(box.triangles).words(), "a closed surface");
  EXPECT_NEAR(enclosed_volume(box.vertices, box.triangles), 6, 1e-14);
}

TEST(SurfaceCheck, NamesWhatIsOpenTurnedAndCrowded) {
  SurfaceMesh box = test::box_surface({1, 1, 1}, {1, 1, 1});
  TriangleArray open = box.triangles.bottomRows(11);
  EXPECT_EQ(surface_faults(open).open, 3);
  EXPECT_EQ(surface_faults(open).turned + surface_faults(open).crowded, 0);
  TriangleArray turned = box.triangles;
  std::swap(turned(0, 1), turned(0, 2));
  EXPECT_EQ(surface_faults(turned).turned, 3);
  EXPECT_EQ(surface_faults(turned).open + surface_faults(turned).crowded, 0);
  EXPECT_EQ(surface_faults(turned).words().substr(0, 44), "3 edges whose two triangles look opposite wa");
  TriangleArray crowded(13, 3);
  crowded << box.triangles, box.triangles.row(0);
  EXPECT_EQ(surface_faults(crowded).crowded, 3);
}

TEST(SurfaceCheck, WeldsVerticesAtOnePlace) {
  const SurfaceMesh box = test::box_surface({2, 2, 2}, {1, 1, 1});
  VertexArray loose(3 * box.triangles.rows(), 3);
  TriangleArray triangles(box.triangles.rows() + 1, 3);
  for (Eigen::Index t = 0; t < box.triangles.rows(); ++t)
    for (int c = 0; c < 3; ++c) {
      loose.row(3 * t + c) = box.vertices.row(box.triangles(t, c));
      triangles(t, c) = static_cast<std::int32_t>(3 * t + c);
    }
  triangles.bottomRows<1>() << 0, 0, 1;  // no triangle
  EXPECT_TRUE(surface_faults(triangles).any());
  weld(loose, triangles);
  EXPECT_EQ(triangles.rows(), box.triangles.rows());
  EXPECT_FALSE(surface_faults(triangles).any());
  EXPECT_NEAR(enclosed_volume(loose, triangles), 1, 1e-15);
}

}  // namespace
}  // namespace exmat
