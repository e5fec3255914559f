#include "runtime/sim/elasticity/reduced_elasticity.h"

#include <gtest/gtest.h>

#include "common/core/decompositions.h"
#include "runtime/sim/step/model.h"
#include "tests/support/random.h"
#include "tests/support/synthetic_model.h"

namespace exmat::runtime {
namespace {

using test::Bar;

class ReducedElasticityTest : public ::testing::Test {
 protected:
  void SetUp() override {
    bar_ = test::make_bar({.examples = 4});
    auto result = build_model(bar_.model, {});
    ASSERT_TRUE(result.model) << to_string(result.complaint);
    elasticity_ = result.model->internal_force.cubature();
    workspace_ = elasticity_.make_workspace();
  }

  /// A pose whose largest displacement is about `share` of the bar's size.
  Eigen::VectorXd pose(std::uint32_t seed, double share) const {
    Eigen::VectorXd q = test::random_vector(bar_.modes(), seed);
    for (Eigen::Index i = 0; i < q.size(); ++i) q[i] /= static_cast<double>((i + 1) * (i + 1));
    return q * (share * bar_.length / (bar_.basis() * q).lpNorm<Eigen::Infinity>());
  }

  Bar bar_;
  ReducedElasticity elasticity_;
  ReducedElasticity::Workspace workspace_;
};

TEST_F(ReducedElasticityTest, ForceIsTheProjectedForceOfTheFullSpace) {
  for (std::uint32_t seed = 0; seed < 5; ++seed) {
    const Eigen::VectorXd q = pose(seed, 0.3);
    Eigen::VectorXd force(bar_.modes());
    elasticity_.force(q, workspace_, force);
    const Eigen::VectorXd expected = bar_.basis().transpose() * test::full_internal_force(bar_, bar_.basis() * q);
    EXPECT_LE((force - expected).norm(), 1e-12 * expected.norm());
  }
}

TEST_F(ReducedElasticityTest, ForceIsTheDerivativeOfTheEnergy) {
  const Eigen::VectorXd q = pose(1, 0.3);
  Eigen::VectorXd force(bar_.modes());
  EXPECT_EQ(elasticity_.force(q, workspace_, force), elasticity_.energy(q, workspace_));
  for (Eigen::Index i = 0; i < q.size(); ++i) {
    // The energy is a quartic polynomial, whose five-point difference is exact but for rounding.
    const double h = 0.02 * q.norm();
    const auto at = [&](double offset) {
      Eigen::VectorXd moved = q;
      moved[i] += offset * h;
      return elasticity_.energy(moved, workspace_);
    };
    const double difference = (at(-2) - 8 * at(-1) + 8 * at(1) - at(2)) / (12 * h);
    EXPECT_NEAR(force[i], difference, 1e-10 * force.norm()) << i;
  }
}

TEST_F(ReducedElasticityTest, StiffnessIsTheDerivativeOfTheForce) {
  const Eigen::VectorXd q = pose(2, 0.3);
  Eigen::MatrixXd stiffness = Eigen::MatrixXd::Zero(bar_.modes(), bar_.modes());
  elasticity_.stiffness(q, Tangent::kExact, workspace_, stiffness);
  const Eigen::MatrixXd full = stiffness.selfadjointView<Eigen::Lower>();
  for (Eigen::Index i = 0; i < q.size(); ++i) {
    const double h = 0.02 * q.norm();
    const auto at = [&](double offset) {
      Eigen::VectorXd moved = q, force(q.size());
      moved[i] += offset * h;
      elasticity_.force(moved, workspace_, force);
      return force;
    };
    const Eigen::VectorXd difference = (at(-2) - 8 * at(-1) + 8 * at(1) - at(2)) / (12 * h);
    EXPECT_LE((full.col(i) - difference).norm(), 1e-11 * full.norm()) << i;
  }
}

TEST_F(ReducedElasticityTest, ForceAndStiffnessAgreesWithTheSeparateCalls) {
  const Eigen::VectorXd q = pose(3, 0.4);
  Eigen::VectorXd force(q.size()), both_force(q.size());
  Eigen::MatrixXd stiffness = Eigen::MatrixXd::Zero(q.size(), q.size()), both_stiffness = stiffness;
  const double energy = elasticity_.force(q, workspace_, force);
  elasticity_.stiffness(q, Tangent::kExact, workspace_, stiffness);
  EXPECT_EQ(elasticity_.force_and_stiffness(q, workspace_, both_force, both_stiffness), energy);
  EXPECT_EQ(both_force, force);
  EXPECT_EQ(both_stiffness, stiffness);
}

TEST_F(ReducedElasticityTest, StiffnessAtRestIsThatOfLinearElasticity) {
  Eigen::MatrixXd stiffness = Eigen::MatrixXd::Zero(bar_.modes(), bar_.modes());
  elasticity_.stiffness(Eigen::VectorXd::Zero(bar_.modes()), Tangent::kExact, workspace_, stiffness);
  const Eigen::MatrixXd expected = bar_.basis().transpose() * bar_.stiffness * bar_.basis();
  EXPECT_LE((stiffness - expected).triangularView<Eigen::Lower>().toDenseMatrix().norm(), 1e-12 * expected.norm());
}

TEST_F(ReducedElasticityTest, ProjectedStiffnessIsPositiveSemidefiniteAndEqualWhereTheExactOneIs) {
  // The last example stretches the bar by 15 percent; this is half its length.
  const Eigen::VectorXd compressed = -3.3 * bar_.basis().transpose() * bar_.mass * bar_.example_fields[3];
  Eigen::MatrixXd exact = Eigen::MatrixXd::Zero(compressed.size(), compressed.size()), projected = exact;
  const auto lowest = [](const Eigen::MatrixXd& lower) {
    return Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(lower).eigenvalues().minCoeff();
  };
  elasticity_.stiffness(compressed, Tangent::kExact, workspace_, exact);
  elasticity_.stiffness(compressed, Tangent::kPositiveSemidefinite, workspace_, projected);
  ASSERT_LT(lowest(exact), 0) << "the pose is too mild for this test";
  EXPECT_GE(lowest(projected), -1e-10 * projected.norm());

  const Eigen::VectorXd rest = Eigen::VectorXd::Zero(compressed.size());
  elasticity_.stiffness(rest, Tangent::kExact, workspace_, exact);
  elasticity_.stiffness(rest, Tangent::kPositiveSemidefinite, workspace_, projected);
  EXPECT_LE((exact - projected).norm(), 1e-12 * exact.norm());
}

}  // namespace
}  // namespace exmat::runtime
