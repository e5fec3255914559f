#include "precompute/targets/tet_parts.h"

#include <algorithm>
#include <gtest/gtest.h>
#include <random>

#include "tests/support/box_mesh.h"

namespace exmat::precompute {
namespace {

std::vector<Eigen::Index> every_third(const TetMesh& mesh) {
  std::vector<Eigen::Index> tets;
  for (Eigen::Index t = 1; t < mesh.tet_count(); t += 3) tets.push_back(t);
  return tets;
}

TEST(TetParts, HoldEachTetOnceWithItsVertices) {
  const TetMesh mesh = test::box_mesh({7, 5, 4}, {1, 1, 1});
  const std::vector<Eigen::Index> tets = every_third(mesh);
  std::vector<Eigen::Index> found;
  for (const TetPart& part : tet_parts(mesh, tets, 20)) {
    EXPECT_LE(part.tets.size(), 20U);
    EXPECT_TRUE(std::ranges::is_sorted(part.tets));
    EXPECT_TRUE(std::ranges::is_sorted(part.vertices));
    EXPECT_EQ(std::ranges::adjacent_find(part.vertices), part.vertices.end());
    ASSERT_EQ(part.corners.cols(), std::ssize(part.tets));
    for (std::size_t i = 0; i < part.tets.size(); ++i)
      for (int c = 0; c < 4; ++c)
        EXPECT_EQ(part.vertices.at(static_cast<std::size_t>(part.corners(c, static_cast<Eigen::Index>(i)))),
                  mesh.tets(part.tets[i], c));
    found.insert(found.end(), part.tets.begin(), part.tets.end());
  }
  std::ranges::sort(found);
  EXPECT_EQ(found, tets);
}

// In whatever order a mesh has its tets: a cube of 8^3 cells has 1.4 vertices a cell, tets at random some hundreds.
TEST(TetParts, ShareVerticesWhateverTheOrderOfTheTets) {
  TetMesh mesh = test::cube_grid(16);
  std::vector<Eigen::Index> order, all;
  for (Eigen::Index t = 0; t < mesh.tet_count(); ++t) order.push_back(t);
  all = order;
  std::ranges::shuffle(order, std::mt19937(1));
  mesh.tets = TetArray(mesh.tets(order, Eigen::all));
  for (const TetPart& part : tet_parts(mesh, all, 6 * 512))
    EXPECT_LE(static_cast<double>(part.vertices.size()), 1.7 * static_cast<double>(part.tets.size()) / 6);
}

TEST(TetParts, OfNothingAreNone) { EXPECT_TRUE(tet_parts(test::cube_grid(1), {}, 4).empty()); }

}  // namespace
}  // namespace exmat::precompute
