#include "precompute/posing/surface_springs.h"

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "tests/support/random.h"
#include "tests/support/surfaces.h"

namespace exmat::precompute {
namespace {

struct SpringsTest : testing::Test {
  TetMesh cage = test::box_mesh({3, 2, 2}, {3, 2, 2});
  SurfaceMesh surface = [] {
    SurfaceMesh box = test::box_surface({5, 3, 3}, {2.4, 1.5, 1.5});
    box.vertices.array() += 0.2;
    return box;
  }();
  Embedding embedding = embed_points(cage, surface.vertices, "surface");
  VertexArray places = surface.vertices + 0.1 * test::random_matrix(surface.vertices.rows(), 3, 1);
  SurfaceSprings springs{cage, surface, embedding, places};
  VertexArray x = cage.vertices + 0.1 * test::random_matrix(cage.vertex_count(), 3, 2);
};

TEST_F(SpringsTest, SharesAreThoseOfTheArea) {
  const Eigen::VectorXd shares = vertex_shares(surface);
  EXPECT_NEAR(shares.sum(), 1, 1e-14);
  // The mean of a linear function over a box's surface is that at its centre.
  const Eigen::RowVector3d mean = shares.transpose() * surface.vertices;
  EXPECT_LT((mean - Eigen::RowVector3d(1.4, 0.95, 0.95)).norm(), 1e-12);
}

TEST_F(SpringsTest, GradientIsThatOfTheEnergy) {
  const VertexArray direction = test::random_matrix(x.rows(), 3, 3);
  // Quadratic: central differences are exact but for rounding.
  const double h = 1e-3;
  const double difference = (springs.energy(x + h * direction) - springs.energy(x - h * direction)) / (2 * h);
  EXPECT_NEAR(springs.gradient(x).cwiseProduct(direction).sum(), difference, 1e-12);
}

TEST_F(SpringsTest, HessianIsThatOfTheGradient) {
  const VertexArray direction = test::random_matrix(x.rows(), 3, 4);
  const VertexArray change = springs.gradient(x + direction) - springs.gradient(x);
  const Eigen::VectorXd product = springs.hessian() * Eigen::VectorXd(direction.reshaped<Eigen::RowMajor>());
  EXPECT_LT((product - Eigen::VectorXd(change.reshaped<Eigen::RowMajor>())).norm(), 1e-13 * (1 + product.norm()));
}

TEST_F(SpringsTest, MissesAreDistances) {
  const Eigen::RowVector3d shift(0.3, -0.4, 1.2);
  const VertexArray moved = cage.vertices.rowwise() + shift;
  const SurfaceSprings at_rest(cage, surface, embedding, surface.vertices);
  EXPECT_NEAR(at_rest.rms(moved), 1.3, 1e-12);
  VertexArray places = surface.vertices;
  places.row(5) += 0.01 * shift;
  Eigen::Index worst = -1;
  EXPECT_NEAR(SurfaceSprings(cage, surface, embedding, places).farthest(cage.vertices, worst), 0.013, 1e-12);
  EXPECT_EQ(worst, 5);
}

TEST_F(SpringsTest, StartGoesWithARigidMotion) {
  const Eigen::Matrix3d rotation = Eigen::AngleAxisd(2.5, Eigen::Vector3d(1, -2, 3).normalized()).toRotationMatrix();
  const Eigen::RowVector3d shift(1, 2, 3);
  const auto move = [&](const VertexArray& points) -> VertexArray {
    return (points * rotation.transpose()).rowwise() + shift;
  };
  EXPECT_LT((rigid_start(cage, surface, move(surface.vertices)) - move(cage.vertices)).norm(), 1e-12);
}

}  // namespace
}  // namespace exmat::precompute
