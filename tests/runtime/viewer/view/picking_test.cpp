#include "runtime/viewer/view/picking.h"

#include <gtest/gtest.h>
#include <random>
#include <vector>

namespace exmat::viewer {
namespace picking_test {

const std::vector<double> kTetrahedron{0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1};
const std::vector<std::int32_t> kFaces{0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3};

Eigen::Vector3d place_of(const SurfaceHit& hit) {
  Eigen::Vector3d place = Eigen::Vector3d::Zero();
  for (std::size_t c = 0; c < 3; ++c)
    place += hit.shares[static_cast<Eigen::Index>(c)] *
             Eigen::Map<const Eigen::Vector3d>(kTetrahedron.data() +
                                               3 * kFaces[3 * static_cast<std::size_t>(hit.triangle) + c]);
  return place;
}

// No place of the surface, by samples, is nearer.
TEST(Picking, FindsTheNearestPlaceOfASurface) {
  std::mt19937 generator(1);
  std::uniform_real_distribution<double> number(-1, 2);
  for (int trial = 0; trial < 50; ++trial) {
    const Eigen::Vector3d point(number(generator), number(generator), number(generator));
    const SurfaceHit found = nearest_place(point, kTetrahedron, kFaces);
    EXPECT_NEAR(found.shares.sum(), 1, 1e-12);
    EXPECT_NEAR((place_of(found) - point).norm(), found.distance, 1e-12);
    for (std::int64_t triangle = 0; triangle < 4; ++triangle)
      for (int i = 0; i <= 20; ++i)
        for (int j = 0; i + j <= 20; ++j)
          EXPECT_GE((place_of({triangle, {i / 20.0, j / 20.0, (20 - i - j) / 20.0}, 0}) - point).norm(),
                    found.distance - 1e-12);
  }
}

}  // namespace picking_test
}  // namespace exmat::viewer
