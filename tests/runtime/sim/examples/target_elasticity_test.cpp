#include "runtime/sim/examples/target_elasticity.h"

#include <Eigen/LU>
#include <gtest/gtest.h>

#include "common/core/decompositions.h"
#include "tests/support/allocation_counter.h"
#include "tests/support/random.h"
#include "tests/support/synthetic_model.h"

namespace exmat::runtime {
namespace target_elasticity_test {

constexpr Eigen::Index kElements = 11, kModes = 7, kCoordinates = 4;  // more than a panel, and not a multiple

TargetElasticityData some_elements() {
  TargetElasticityData data;
  data.weights = 1.5 * Eigen::VectorXd::Ones(kElements) + test::random_vector(kElements, 1);
  data.volumes = 2e-3 * Eigen::VectorXd::Ones(kElements) + 1e-3 * test::random_vector(kElements, 2);
  data.gradient = test::random_matrix(9 * kElements, kModes, 3);
  data.target_gradient = test::random_matrix(9 * kElements, kCoordinates, 4);
  data.youngs_modulus = Eigen::VectorXd::LinSpaced(kElements, 1e4, 1e5);
  data.poisson_ratio = Eigen::VectorXd::LinSpaced(kElements, 0.1, 0.4);
  return data;
}

Eigen::Matrix3d deformation_gradient(const RowMatrix& gradient, Eigen::Index j, const Eigen::VectorXd& x) {
  const Eigen::VectorXd flat = gradient.middleRows<9>(9 * j) * x;
  return Eigen::Matrix3d::Identity() + flat.reshaped<Eigen::RowMajor>(3, 3);
}

/// From its definition, F by F.
double defined_energy(MaterialModel material, const TargetElasticityData& data, const Eigen::VectorXd& q,
                      const Eigen::VectorXd& y, double factor) {
  double sum = 0;
  for (Eigen::Index j = 0; j < data.weights.size(); ++j) {
    const Eigen::Matrix3d target = deformation_gradient(data.target_gradient, j, y);
    if (target.determinant() <= 0) continue;
    const Eigen::Matrix3d F = deformation_gradient(data.gradient, j, q) * target.inverse();
    sum += data.weights[j] * data.volumes[j] * target.determinant() *
           test::energy_density(material, F, data.youngs_modulus[j], data.poisson_ratio[j]);
  }
  return factor * sum;
}

class TargetElasticityOf : public testing::TestWithParam<MaterialModel> {
 protected:
  TargetElasticityOf()
      : elasticity_(GetParam(), data_, RowMatrix::Identity(kCoordinates, kCoordinates)),
        workspace_(elasticity_.make_workspace()) {}

  TargetElasticityData data_ = some_elements();
  TargetElasticity elasticity_;
  TargetElasticity::Workspace workspace_;
  const Eigen::VectorXd q_ = 0.1 * test::random_vector(kModes, 5), y_ = 0.1 * test::random_vector(kCoordinates, 6);
};

INSTANTIATE_TEST_SUITE_P(Materials, TargetElasticityOf,
                         testing::Values(MaterialModel::kStVenantKirchhoff, MaterialModel::kStableNeoHookean,
                                         MaterialModel::kCorotational));

TEST_P(TargetElasticityOf, EnergyIsThatOfItsDefinition) {
  elasticity_.set_target(y_, 0.7, workspace_);
  const double expected = defined_energy(GetParam(), data_, q_, y_, 0.7);
  ASSERT_GT(expected, 0);
  EXPECT_NEAR(elasticity_.energy(q_, workspace_), expected, 1e-10 * expected);
}

TEST_P(TargetElasticityOf, ForceAndStiffnessAreItsDerivatives) {
  elasticity_.set_target(y_, 0.7, workspace_);
  constexpr double kStep = 1e-5;
  Eigen::VectorXd force = Eigen::VectorXd::Zero(kModes);
  EXPECT_DOUBLE_EQ(elasticity_.add_force(q_, workspace_, force), elasticity_.energy(q_, workspace_));
  Eigen::MatrixXd stiffness = Eigen::MatrixXd::Zero(kModes, kModes);
  elasticity_.add_stiffness(q_, Tangent::kExact, workspace_, stiffness);
  stiffness = Eigen::MatrixXd(stiffness.selfadjointView<Eigen::Lower>());
  for (Eigen::Index i = 0; i < kModes; ++i) {
    const Eigen::VectorXd h = kStep * Eigen::VectorXd::Unit(kModes, i);
    const double slope =
        (defined_energy(GetParam(), data_, q_ + h, y_, 0.7) - defined_energy(GetParam(), data_, q_ - h, y_, 0.7)) /
        (2 * kStep);
    EXPECT_NEAR(force[i], slope, 1e-7 * force.norm()) << i;
    Eigen::VectorXd ahead = Eigen::VectorXd::Zero(kModes), behind = ahead;
    elasticity_.add_force(q_ + h, workspace_, ahead);
    elasticity_.add_force(q_ - h, workspace_, behind);
    EXPECT_LE(((ahead - behind) / (2 * kStep) - stiffness.col(i)).norm(), 1e-7 * stiffness.norm()) << i;
  }
}

TEST_P(TargetElasticityOf, ProjectedStiffnessHasNoNegativeEigenvalue) {
  elasticity_.set_target(y_, 1, workspace_);
  Eigen::MatrixXd exact = Eigen::MatrixXd::Zero(kModes, kModes), projected = exact;
  const Eigen::VectorXd far = -0.6 * test::random_vector(kModes, 5).cwiseAbs();
  elasticity_.add_stiffness(far, Tangent::kExact, workspace_, exact);
  elasticity_.add_stiffness(far, Tangent::kPositiveSemidefinite, workspace_, projected);
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(projected, Eigen::EigenvaluesOnly);
  EXPECT_GE(eigen.eigenvalues()[0], -1e-10 * eigen.eigenvalues().tail(1)[0]);
  EXPECT_GT((projected - exact).norm(), 0);
}

// A factor adds to what is there.
TEST_P(TargetElasticityOf, IsNoForceInTheTarget) {
  TargetElasticityData data = some_elements();
  data.target_gradient = data.gradient;
  const TargetElasticity elasticity(GetParam(), data, RowMatrix::Identity(kModes, kModes));
  auto workspace = elasticity.make_workspace();
  elasticity.set_target(q_, 3, workspace);
  Eigen::VectorXd force = Eigen::VectorXd::Ones(kModes), elsewhere = Eigen::VectorXd::Zero(kModes);
  elasticity.add_force(Eigen::VectorXd::Zero(kModes), workspace, elsewhere);
  ASSERT_GT(elsewhere.norm(), 1);
  EXPECT_LE(elasticity.add_force(q_, workspace, force), 1e-14 * elsewhere.norm());
  EXPECT_LE((force - Eigen::VectorXd::Ones(kModes)).norm(), 1e-12 * elsewhere.norm());
}

TEST_P(TargetElasticityOf, ElementsThatTheTargetInvertsTakeNoPart) {
  data_.target_gradient.middleRows<9>(18) *= 0;
  data_.target_gradient(18, 0) = -30;  // det F* = 1 - 30 y_0
  const TargetElasticity elasticity(GetParam(), data_, RowMatrix::Identity(kCoordinates, kCoordinates));
  auto workspace = elasticity.make_workspace();
  const Eigen::VectorXd y = 0.1 * Eigen::VectorXd::Unit(kCoordinates, 0);
  ASSERT_LT(deformation_gradient(data_.target_gradient, 2, y).determinant(), 0);
  elasticity.set_target(y, 1, workspace);
  const double expected = defined_energy(GetParam(), data_, q_, y, 1);
  EXPECT_NEAR(elasticity.energy(q_, workspace), expected, 1e-10 * expected);
  Eigen::MatrixXd stiffness = Eigen::MatrixXd::Zero(kModes, kModes);
  Eigen::VectorXd force = Eigen::VectorXd::Zero(kModes);
  elasticity.add_force(q_, workspace, force);
  elasticity.add_stiffness(q_, Tangent::kPositiveSemidefinite, workspace, stiffness);
  EXPECT_TRUE(force.allFinite() && stiffness.allFinite());
}

TEST_P(TargetElasticityOf, AllocatesNothing) {
  if (!test::AllocationCounter::works()) GTEST_SKIP();
  Eigen::VectorXd force = Eigen::VectorXd::Zero(kModes);
  Eigen::MatrixXd stiffness = Eigen::MatrixXd::Zero(kModes, kModes);
  const test::AllocationCounter counter;
  elasticity_.set_target(y_, 1, workspace_);
  elasticity_.energy(q_, workspace_);
  elasticity_.add_force(q_, workspace_, force);
  elasticity_.add_stiffness(q_, Tangent::kExact, workspace_, stiffness);
  elasticity_.add_stiffness(q_, Tangent::kPositiveSemidefinite, workspace_, stiffness);
  EXPECT_EQ(counter.count(), 0U);
}

// A block at rest whose target is stretched by a: F F*^-1 = diag(1/a, 1, 1), so that its Green strain is
// (1/a^2 - 1)/2 along the axis and V a (lambda/2 + mu) E^2 its energy of St.Venant-Kirchhoff.
TEST(TargetElasticity, OfAUniformStretchIsThatOfTheClosedForm) {
  TargetElasticityData data;
  data.weights = Eigen::VectorXd::Constant(1, 2);
  data.volumes = Eigen::VectorXd::Constant(1, 0.25);
  data.gradient = RowMatrix::Identity(9, 9);
  data.target_gradient = RowMatrix::Identity(9, 1);
  data.youngs_modulus = Eigen::VectorXd::Constant(1, 1e3);
  data.poisson_ratio = Eigen::VectorXd::Constant(1, 0.25);
  const double lambda = 400, mu = 400, a = 1.5, strain = (1 / (a * a) - 1) / 2, e = 0.3;
  const TargetElasticity elasticity(MaterialModel::kStVenantKirchhoff, data, RowMatrix::Identity(1, 1));
  auto workspace = elasticity.make_workspace();
  elasticity.set_target(Eigen::VectorXd::Constant(1, a - 1), e, workspace);
  const double expected = e * 0.5 * a * (lambda / 2 + mu) * strain * strain;
  EXPECT_NEAR(elasticity.energy(Eigen::VectorXd::Zero(9), workspace), expected, 1e-13 * expected);
  EXPECT_NEAR(elasticity.energy((a - 1) * Eigen::VectorXd::Unit(9, 0), workspace), 0, 1e-13 * expected);
}

}  // namespace target_elasticity_test
}  // namespace exmat::runtime
