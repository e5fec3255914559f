#include "precompute/study/measure/inverted_tets.h"

#include <gtest/gtest.h>
#include <limits>

#include "tests/support/box_mesh.h"

namespace exmat::precompute {
namespace {

// A cube of six tets about the diagonal from (0, 0, 0) to (1, 1, 1). Vertex 1 at (1, 0, 0) is of two of them: it
// crosses the opposite side of the one where x = y, and of the other where x = z.
class InvertedTetsOfACube : public testing::Test {
 protected:
  VertexArray with_vertex_1_at(double x, double y, double z) const {
    VertexArray positions = cube_.vertices;
    positions.row(1) << x, y, z;
    return positions;
  }

  TetMesh cube_ = test::box_mesh({1, 1, 1}, {1, 1, 1});
};

TEST_F(InvertedTetsOfACube, AreCountedByTheirVertices) {
  EXPECT_EQ(inverted_tet_count(cube_, cube_.vertices), 0);
  EXPECT_EQ(inverted_tet_count(cube_, with_vertex_1_at(0.5, 0.4, 0.2)), 0);
  EXPECT_EQ(inverted_tet_count(cube_, with_vertex_1_at(0.5, 0.8, 0.2)), 1);
  EXPECT_EQ(inverted_tet_count(cube_, with_vertex_1_at(0.5, 0.8, 0.9)), 2);
  EXPECT_EQ(inverted_tet_count(cube_, with_vertex_1_at(0.5, 0.5, 0.2)), 1) << "flat";
}

TEST_F(InvertedTetsOfACube, AreAllOrNoneOfAnAffineMap) {
  Eigen::Matrix3d map;
  map << 0, -2, 0, 3, 0, 1, 0, 0, 1;  // det 6
  EXPECT_EQ(inverted_tet_count(cube_, cube_.vertices * map.transpose()), 0);
  EXPECT_EQ(inverted_tet_count(cube_, -cube_.vertices * map.transpose()), 6);
  EXPECT_EQ(inverted_tet_count(cube_, 0 * cube_.vertices), 6);
}

// Tets whose vertices are in the other order are sound at rest.
TEST_F(InvertedTetsOfACube, AreMeasuredFromRest) {
  cube_.tets.col(0).swap(cube_.tets.col(1));
  EXPECT_EQ(inverted_tet_count(cube_, cube_.vertices), 0);
  EXPECT_EQ(inverted_tet_count(cube_, with_vertex_1_at(0.5, 0.8, 0.2)), 1);
}

TEST_F(InvertedTetsOfACube, OfAMotionAreTheMostAndTheLast) {
  const VertexArray none = cube_.vertices, one = with_vertex_1_at(0.5, 0.8, 0.2), two = with_vertex_1_at(0.5, 0.8, 0.9);
  EXPECT_FALSE(inverted_tets(cube_, {none, none}).any());
  const InvertedTets found = inverted_tets(cube_, {none, two, one});
  EXPECT_EQ(found.most, 2);
  EXPECT_EQ(found.last, 1);
  EXPECT_TRUE(found.any());
  const InvertedTets recovered = inverted_tets(cube_, {one, none});
  EXPECT_EQ(recovered.most, 1);
  EXPECT_EQ(recovered.last, 0);
  EXPECT_FALSE(inverted_tets(cube_, std::vector<VertexArray>{}).any());
}

TEST_F(InvertedTetsOfACube, AreThoseThatAreNoNumber) {
  EXPECT_EQ(inverted_tet_count(cube_, with_vertex_1_at(std::numeric_limits<double>::quiet_NaN(), 0, 0)), 2);
}

}  // namespace
}  // namespace exmat::precompute
