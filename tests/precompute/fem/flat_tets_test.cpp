#include "precompute/fem/flat_tets.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "precompute/solvers/mesh_blame.h"
#include "tests/support/box_mesh.h"
#include "tests/support/flat_tets.h"

namespace exmat::precompute {
namespace {

// A tet with a right angle at each edge of one corner: volume 1/6, largest face sqrt(3) / 2, longest edge sqrt(2).
TEST(FlattestTet, HasTheHeightOfACornerOfACube) {
  TetMesh mesh;
  mesh.vertices.resize(4, 3);
  mesh.vertices << 0, 0, 0, 2, 0, 0, 0, 2, 0, 0, 0, 2;
  mesh.tets.resize(1, 4);
  mesh.tets << 0, 1, 2, 3;
  EXPECT_NEAR(flattest_tet(mesh).height, 1 / std::sqrt(6.0), 1e-15);
}

TEST(FlattestTet, IsTheOneThatWasMadeFlat) {
  const TetMesh mesh = test::with_flat_tets(test::box_mesh({4, 2, 2}, {4, 2, 2}), 1, 1e-6);
  const FlatTet flattest = flattest_tet(mesh);
  EXPECT_EQ(flattest.tet, 0);
  EXPECT_LT(flattest.height, 1e-6);
  EXPECT_GT(flattest.height, 1e-7);
}

TEST(MeshBlame, IsWithFlatTetsAlone) {
  const auto fail = [] { throw IllConditioned("no factors"); };
  const TetMesh sound = test::box_mesh({4, 2, 2}, {4, 2, 2});
  EXPECT_THROW(with_mesh_blamed(sound, "body", fail), IllConditioned);
  try {
    with_mesh_blamed(test::with_flat_tets(sound, 1, 1e-6), "body", fail);
    FAIL() << "nothing thrown";
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(),
                testing::HasSubstr("mesh of body: expected tets that are not flat, found tet 1 (1-based) at"));
    EXPECT_THAT(error.what(), testing::HasSubstr("no factors"));
  }
}

}  // namespace
}  // namespace exmat::precompute
