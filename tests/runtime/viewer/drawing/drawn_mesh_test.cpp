#include "runtime/viewer/drawing/drawn_mesh.h"

#include <algorithm>
#include <gtest/gtest.h>
#include <set>

#include "runtime/viewer/drawing/solid_mesh.h"

namespace exmat::viewer {
namespace {

const std::vector<double> kCube{0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0, 0, 0, 1, 1, 0, 1, 1, 1, 1, 0, 1, 1};
const std::vector<std::int32_t> kFaces{0, 2, 1, 0, 3, 2, 4, 5, 6, 4, 6, 7, 0, 1, 5, 0, 5, 4,
                                       1, 2, 6, 1, 6, 5, 2, 3, 7, 2, 7, 6, 3, 0, 4, 3, 4, 7};

TEST(DrawnMesh, OfACubeHasThreeNormalsAtEachPoint) {
  const DrawnMesh mesh = make_drawn_mesh(kCube, kFaces);
  EXPECT_EQ(mesh.points.size(), 24U);
  EXPECT_EQ(mesh.edges.size(), 2U * 18U);
  for (std::size_t i = 0; i < kFaces.size(); ++i)
    EXPECT_EQ(mesh.points[mesh.indices[i]], static_cast<std::uint32_t>(kFaces[i]));
  // Around a corner are the triangles that use it, each once.
  for (std::size_t corner = 0; corner < mesh.points.size(); ++corner) {
    std::set<std::uint32_t> users;
    for (std::size_t i = 0; i < mesh.indices.size(); ++i)
      if (mesh.indices[i] == corner) users.insert(static_cast<std::uint32_t>(i / 3));
    const auto begin = mesh.around.begin();
    EXPECT_EQ(std::set<std::uint32_t>(begin + mesh.starts[corner], begin + mesh.starts[corner + 1]), users);
  }
}

TEST(DrawnMesh, OfASmoothCubeHasOne) { EXPECT_EQ(make_drawn_mesh(kCube, kFaces, 3).points.size(), 8U); }

TEST(SolidMesh, LiesOnItsShape) {
  const Eigen::Vector3d start(0.1, 0.2, 0.3), axis(0.4, -0.5, 0.9);
  const SolidMesh capsule = make_capsule(start, axis, 0.25);
  for (std::size_t i = 0; i < capsule.points.size(); i += 6) {
    const Eigen::Vector3d p = Eigen::Map<const Eigen::Vector3f>(capsule.points.data() + i).cast<double>();
    const Eigen::Vector3d n = Eigen::Map<const Eigen::Vector3f>(capsule.points.data() + i + 3).cast<double>();
    const double t = std::clamp((p - start).dot(axis) / axis.squaredNorm(), 0.0, 1.0);
    EXPECT_NEAR((p - start - t * axis).norm(), 0.25, 1e-6);
    EXPECT_LE((p - start - t * axis - 0.25 * n).norm(), 1e-6);
  }
  const SolidMesh box = make_box(start, {1, 2, 3}, Eigen::Matrix3d::Identity());
  EXPECT_EQ(box.indices.size(), 36U);
  for (const SolidMesh* mesh : {&capsule, &box})
    for (const std::uint32_t index : mesh->indices) EXPECT_LT(6 * index, mesh->points.size());
}

}  // namespace
}  // namespace exmat::viewer
