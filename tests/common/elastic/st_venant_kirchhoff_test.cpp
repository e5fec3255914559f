#include "common/elastic/st_venant_kirchhoff.h"

#include <Eigen/Geometry>
#include <gtest/gtest.h>
#include <random>

#include "common/core/decompositions.h"
#include "common/mesh/geometry.h"
#include "tests/support/box_mesh.h"

namespace exmat {
namespace st_venant_kirchhoff_test {

using Material = StVenantKirchhoff;

constexpr LameParameters kLame{3.0, 7.0};

Eigen::Matrix3d random_matrix(std::mt19937& generator, double size) {
  std::uniform_real_distribution<double> entry(-size, size);
  return Eigen::Matrix3d::NullaryExpr([&] { return entry(generator); });
}

double dot(const Eigen::Matrix3d& a, const Eigen::Matrix3d& b) { return a.cwiseProduct(b).sum(); }

// Central differences of step h err by h^2 f'''/6 and rounding/h; 1e-5 balances them at 1e-10 of the values here, of
// order 10.
constexpr double kStep = 1e-5;
constexpr double kTolerance = 1e-8;

TEST(StVenantKirchhoff, StressIsTheGradientOfTheEnergy) {
  std::mt19937 generator(1);
  for (int trial = 0; trial < 20; ++trial) {
    const Eigen::Matrix3d H = random_matrix(generator, 0.8), D = random_matrix(generator, 1.0);
    const double difference =
        (Material::energy(H + kStep * D, kLame) - Material::energy(H - kStep * D, kLame)) / (2 * kStep);
    EXPECT_NEAR(difference, dot(Material::first_piola_kirchhoff(H, kLame), D), kTolerance);
  }
}

TEST(StVenantKirchhoff, TangentIsTheGradientOfTheStress) {
  std::mt19937 generator(2);
  for (int trial = 0; trial < 20; ++trial) {
    const Eigen::Matrix3d H = random_matrix(generator, 0.8), D = random_matrix(generator, 1.0);
    const Eigen::Matrix3d difference = (Material::first_piola_kirchhoff(H + kStep * D, kLame) -
                                        Material::first_piola_kirchhoff(H - kStep * D, kLame)) /
                                       (2 * kStep);
    const Matrix9 tangent = Material::tangent(H, kLame);
    const Eigen::Matrix<double, 9, 1> flat = D.reshaped<Eigen::RowMajor>();
    const Eigen::Matrix<double, 9, 1> change = tangent * flat;
    EXPECT_LE((change - difference.reshaped<Eigen::RowMajor>()).norm(), kTolerance * 10);
    EXPECT_LE((tangent - tangent.transpose()).norm(), 1e-12);
  }
}

TEST(StVenantKirchhoff, RestSecondDerivativeIsTheMixedDifferenceOfTheStress) {
  std::mt19937 generator(3);
  const Eigen::Matrix3d A = random_matrix(generator, 1.0), B = random_matrix(generator, 1.0);
  const auto P = [](const Eigen::Matrix3d& H) { return Material::first_piola_kirchhoff(H, kLame); };
  // The stress is a cubic polynomial: its odd terms cancel and the mixed difference is exact.
  const Eigen::Matrix3d mixed = (P(A + B) - P(A - B) - P(B - A) + P(-A - B)) / 4;
  EXPECT_LE((mixed - Material::rest_second_derivative(A, B, kLame)).norm(), 1e-12 * mixed.norm());
}

TEST(StVenantKirchhoff, EnergyDoesNotSeeRotations) {
  std::mt19937 generator(4);
  for (int trial = 0; trial < 20; ++trial) {
    const Eigen::Matrix3d H = random_matrix(generator, 0.5);
    const Eigen::Matrix3d I = Eigen::Matrix3d::Identity();
    const Eigen::Matrix3d R =
        Eigen::AngleAxisd(0.3 * trial, random_matrix(generator, 1.0).col(0).normalized()).toRotationMatrix();
    const Eigen::Matrix3d left = R * (I + H) - I, right = (I + H) * R - I;
    EXPECT_NEAR(Material::energy(left, kLame), Material::energy(H, kLame), 1e-12 * Material::energy(H, kLame));
    EXPECT_NEAR(Material::energy(right, kLame), Material::energy(H, kLame), 1e-12 * Material::energy(H, kLame));
    EXPECT_LE(Material::first_piola_kirchhoff(R - I, kLame).norm(), 1e-13);
  }
}

TEST(StVenantKirchhoff, SmallStrainsKeepTheirDigits) {
  Eigen::Matrix3d H = Eigen::Matrix3d::Zero();
  H(0, 0) = 1e-12;
  // Uniaxial strain: Psi = (lambda/2 + mu) e^2 (1 + e + ...).
  EXPECT_NEAR(Material::energy(H, kLame) / ((0.5 * kLame.lambda + kLame.mu) * 1e-24), 1.0, 1e-11);
}

TEST(StVenantKirchhoff, PatchTestHasNoForceInside) {
  TetMesh mesh = test::box_mesh({3, 3, 3}, {1, 1, 1});
  std::mt19937 generator(5);
  std::uniform_real_distribution<double> shift(-0.05, 0.05);
  const auto inside = [&mesh](Eigen::Index v) {
    return mesh.vertices.row(v).minCoeff() > 1e-9 && mesh.vertices.row(v).maxCoeff() < 1 - 1e-9;
  };
  Eigen::VectorX<bool> interior(mesh.vertex_count());
  for (Eigen::Index v = 0; v < mesh.vertex_count(); ++v) interior[v] = inside(v);
  for (Eigen::Index v = 0; v < mesh.vertex_count(); ++v)
    if (interior[v])
      for (int axis = 0; axis < 3; ++axis) mesh.vertices(v, axis) += shift(generator);

  // An affine displacement deforms every tet alike, however irregular the mesh.
  const Eigen::Matrix3d H = random_matrix(generator, 0.3);
  const Eigen::Matrix3d P = Material::first_piola_kirchhoff(H, kLame);
  const Eigen::VectorXd volumes = tet_volumes(mesh);
  VertexArray forces = VertexArray::Zero(mesh.vertex_count(), 3);
  for (Eigen::Index t = 0; t < mesh.tet_count(); ++t) {
    const auto gradients = shape_gradients(tet_positions(mesh, t));
    Eigen::Matrix3d own = Eigen::Matrix3d::Zero();
    for (int corner = 0; corner < 4; ++corner)
      own += H * mesh.vertices.row(mesh.tets(t, corner)).transpose() * gradients.row(corner);
    ASSERT_LE((own - H).norm(), 1e-13);
    const Eigen::Matrix<double, 4, 3> local =
        volumes[t] * gradients * Material::first_piola_kirchhoff(own, kLame).transpose();
    for (int corner = 0; corner < 4; ++corner) forces.row(mesh.tets(t, corner)) += local.row(corner);
  }
  for (Eigen::Index v = 0; v < mesh.vertex_count(); ++v)
    if (interior[v]) {
      EXPECT_LE(forces.row(v).norm(), 1e-13 * P.norm());
    }
  EXPECT_GT(forces.norm(), 0.1 * P.norm());
}

TEST(ProjectPositiveSemidefinite, ClampsNegativeEigenvaluesOnly) {
  Eigen::Matrix3d H = Eigen::Matrix3d::Zero();
  H.diagonal() << -0.6, 0.2, 0.1;
  const Matrix9 tangent = Material::tangent(H, kLame);
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, 9, 9>> before(tangent),
      after(project_positive_semidefinite(tangent));
  ASSERT_LT(before.eigenvalues()[0], -0.1);
  EXPECT_LE((after.eigenvalues() - before.eigenvalues().cwiseMax(0.0)).norm(), 1e-12 * before.eigenvalues().norm());
}

}  // namespace st_venant_kirchhoff_test
}  // namespace exmat
