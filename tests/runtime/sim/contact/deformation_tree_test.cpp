#include "runtime/sim/contact/deformation_tree.h"

#include <algorithm>
#include <gtest/gtest.h>

#include "common/mesh/geometry.h"
#include "tests/support/synthetic_model.h"

namespace exmat::runtime {
namespace {

TEST(DeformationTree, BallsHoldTheirTrianglesAtAnyPose) {
  const test::Bar bar = test::make_bar({.free = true});
  const TetMesh& mesh = bar.model.object->mesh;
  const TriangleArray triangles = surface_triangles(mesh.tets);
  const DeformationTree tree(triangles, mesh.vertices, bar.basis(), 8);
  std::vector<int> order = tree.order();
  std::ranges::sort(order);
  for (int i = 0; i < triangles.rows(); ++i) ASSERT_EQ(order[static_cast<std::size_t>(i)], i);
  for (int trial = 0; trial < 5; ++trial) {
    const Eigen::VectorXd q = Eigen::VectorXd::Random(bar.modes());
    const Eigen::VectorXd moved = bar.basis() * q;
    for (int n = 0; n < static_cast<int>(tree.nodes().size()); ++n) {
      const DeformationTree::Node& node = tree.node(n);
      const DeformationTree::Ball ball = tree.ball(n, q, q.norm());
      for (int i = node.first; i < node.last; ++i)
        for (int c = 0; c < 3; ++c) {
          const int vertex = triangles(tree.order()[static_cast<std::size_t>(i)], c);
          const Eigen::Vector3d at = mesh.vertices.row(vertex).transpose() + moved.segment<3>(3 * vertex);
          EXPECT_LE((at - ball.centre).norm(), ball.radius * (1 + 1e-12));
        }
    }
  }
}

TEST(DeformationTree, OfNothingIsEmpty) {
  EXPECT_TRUE(DeformationTree(IndexMatrix(0, 1), VertexArray(0, 3), RowMatrix(0, 4), 8).empty());
}

}  // namespace
}  // namespace exmat::runtime
