#include "precompute/alignment/arap_energy.h"

#include <gtest/gtest.h>

#include "tests/support/posed_bodies.h"
#include "tests/support/random.h"

namespace exmat::precompute {
namespace {

const TetMesh& body() {
  static const TetMesh mesh = test::centred(test::shaken_box({5, 3, 2}, {2, 1, 0.7}, 5));
  return mesh;
}

VertexArray shaken(double size) {
  return body().vertices + size * VertexArray(test::random_matrix(body().vertex_count(), 3, 9));
}

TEST(ArapEnergy, RigidMotionCostsNothingAndItsRotationIsFound) {
  const ArapEnergy arap(body());
  const Eigen::Matrix3d R = Eigen::AngleAxisd(2.8, Eigen::Vector3d(1, -2, 3).normalized()).toRotationMatrix();
  VertexArray moved = body().vertices * R.transpose();
  moved.rowwise() += Eigen::RowVector3d(3, 4, 5);
  EXPECT_LE(arap.energy(moved), 1e-26);
  EXPECT_LE(arap.gradient(moved).cwiseAbs().maxCoeff(), 1e-13);
  for (const auto& found : arap.rotations(moved)) EXPECT_LE((found - R).norm(), 1e-12);
  EXPECT_EQ(arap.inverted_fraction(moved), 0);
}

// |diag(1.2, 0.9, 1) - I|^2 in every tet.
TEST(ArapEnergy, OfAUniformStretchIsKnown) {
  const ArapEnergy arap(body());
  const VertexArray stretched = body().vertices * Eigen::Vector3d(1.2, 0.9, 1).asDiagonal();
  EXPECT_NEAR(arap.energy(stretched), 0.04 + 0.01, 1e-13);
  const VertexArray mirrored = body().vertices * Eigen::Vector3d(-1, 1, 1).asDiagonal();
  EXPECT_NEAR(arap.energy(mirrored), 4, 1e-12);  // the nearest rotation is off by 2 along one axis
  EXPECT_NEAR(arap.inverted_fraction(mirrored), 1, 1e-12);
}

// Half of the length squeezed by five, the other half longer by as much: 0.2 and 1.8 of a volume, the whole as it was.
TEST(ArapEnergy, SqueezedVolumeIsThatBesideTheWhole) {
  const TetMesh box = test::box_mesh({4, 2, 2}, {4, 1, 1});
  const ArapEnergy arap(box);
  VertexArray x = box.vertices;
  for (auto vertex : x.rowwise()) vertex[0] = vertex[0] < 2 ? 0.2 * vertex[0] : 0.4 + 1.8 * (vertex[0] - 2);
  EXPECT_NEAR(arap.squeezed_fraction(x, 4), 0.5, 1e-12);
  EXPECT_EQ(arap.squeezed_fraction(x, 6), 0);
  EXPECT_EQ(arap.squeezed_fraction(3 * box.vertices, 4), 0);  // 27 times, everywhere
}

// Central differences of step h err by h^2 and rounding / h: 1e-8 at h = 1e-5.
TEST(ArapEnergy, GradientAgreesWithDifferences) {
  const ArapEnergy arap(body());
  const VertexArray x = shaken(0.05), direction = test::random_matrix(x.rows(), 3, 4);
  constexpr double kStep = 1e-5;
  const double difference = (arap.energy(x + kStep * direction) - arap.energy(x - kStep * direction)) / (2 * kStep);
  EXPECT_NEAR(arap.gradient(x).cwiseProduct(direction).sum(), difference, 1e-7 * std::abs(difference) + 1e-9);
}

// With the rotations held, the energy is the quadratic form of the global step; its minimum is no higher.
TEST(ArapEnergy, GlobalStepIsItsQuadraticForm) {
  const ArapEnergy arap(body());
  const VertexArray x = shaken(0.05), y = shaken(0.02);
  const auto R = arap.rotations(x);
  const VertexArray load = arap.load(R);
  const auto quadratic = [&](const VertexArray& z) {
    return (z.transpose() * (arap.stiffness() * z)).trace() - 2 * z.cwiseProduct(load).sum();
  };
  EXPECT_NEAR(arap.energy(x) - quadratic(x), 3, 1e-12);  // sum of V |R|^2
  EXPECT_LE(arap.energy(y), quadratic(y) + 3 + 1e-12);   // these rotations are not the best at y
}

}  // namespace
}  // namespace exmat::precompute
