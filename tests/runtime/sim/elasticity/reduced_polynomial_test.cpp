#include "runtime/sim/elasticity/reduced_polynomial.h"

#include <gtest/gtest.h>

#include "runtime/sim/elasticity/internal_force.h"
#include "tests/support/random.h"
#include "tests/support/synthetic_model.h"
#include "tests/support/synthetic_polynomial.h"

namespace exmat::runtime {
namespace {

constexpr double kTolerance = 1e-12;

/// The polynomial of a bar, and cubature with all of its elements.
class ReducedPolynomialTest : public ::testing::TestWithParam<int> {
 protected:
  ReducedPolynomialTest()
      : bar_(test::make_bar({.linear_modes = GetParam(), .examples = GetParam() > 5 ? 4 : 0})),
        polynomial_(test::make_polynomial(*bar_.model.cubature)),
        elasticity_(MaterialModel::kStVenantKirchhoff, *bar_.model.cubature),
        scratch_(polynomial_.make_workspace()),
        elasticity_scratch_(elasticity_.make_workspace()) {}

  /// From small ones to such that double the length of the bar.
  Eigen::VectorXd pose(std::uint32_t seed) const {
    const Eigen::VectorXd random = test::random_vector(bar_.modes(), seed);
    const double largest = (bar_.basis() * random).reshaped(3, bar_.basis().rows() / 3).colwise().norm().maxCoeff();
    return std::pow(10, -0.5 * seed) * bar_.length / largest * random;
  }

  test::Bar bar_;
  ReducedPolynomial polynomial_;
  ReducedElasticity elasticity_;
  ReducedPolynomial::Workspace scratch_;
  ReducedElasticity::Workspace elasticity_scratch_;
};

// Numbers of modes and of their pairs that fill whole vectors and not.
INSTANTIATE_TEST_SUITE_P(Modes, ReducedPolynomialTest, ::testing::Values(1, 2, 5, 8, 13, 20));

TEST_P(ReducedPolynomialTest, AgreesWithTheSumOverAllElements) {
  const Eigen::Index r = bar_.modes();
  Eigen::VectorXd force(r), expected_force(r);
  Eigen::MatrixXd stiffness = Eigen::MatrixXd::Zero(r, r), expected_stiffness = stiffness;
  for (std::uint32_t seed = 0; seed < 6; ++seed) {
    const Eigen::VectorXd q = pose(seed);
    const double energy = polynomial_.force_and_stiffness(q, scratch_, force, stiffness);
    const double expected = elasticity_.force_and_stiffness(q, elasticity_scratch_, expected_force, expected_stiffness);
    EXPECT_NEAR(energy, expected, kTolerance * expected) << seed;
    EXPECT_LE((force - expected_force).norm(), kTolerance * expected_force.norm()) << seed;
    const Eigen::MatrixXd difference = (stiffness - expected_stiffness).triangularView<Eigen::Lower>();
    EXPECT_LE(difference.norm(), kTolerance * expected_stiffness.norm()) << seed;
  }
}

TEST_P(ReducedPolynomialTest, ItsCallsAgreeWithEachOther) {
  const Eigen::VectorXd q = pose(1);
  Eigen::VectorXd force(q.size()), both_force(q.size());
  Eigen::MatrixXd stiffness = Eigen::MatrixXd::Zero(q.size(), q.size());
  const double energy = polynomial_.energy(q, scratch_);
  EXPECT_EQ(polynomial_.force(q, scratch_, force), energy);
  EXPECT_EQ(polynomial_.force_and_stiffness(q, scratch_, both_force, stiffness), energy);
  EXPECT_EQ(both_force, force);
}

TEST_P(ReducedPolynomialTest, RestHasNeitherEnergyNorForce) {
  const Eigen::VectorXd rest = Eigen::VectorXd::Zero(bar_.modes());
  Eigen::VectorXd force(rest.size());
  EXPECT_EQ(polynomial_.force(rest, scratch_, force), 0);
  EXPECT_EQ(force, rest);
}

TEST_P(ReducedPolynomialTest, InternalForceTakesItAndProjectsTheTangentsOfTheElements) {
  const InternalForce internal_force(elasticity_, polynomial_);
  auto workspace = internal_force.make_workspace();
  const Eigen::VectorXd q = pose(1);
  EXPECT_EQ(internal_force.energy(q, workspace), polynomial_.energy(q, scratch_));
  const Eigen::Index r = bar_.modes();
  Eigen::MatrixXd stiffness = Eigen::MatrixXd::Zero(r, r), expected = stiffness;
  Eigen::VectorXd force(r);
  internal_force.stiffness(q, Tangent::kExact, workspace, stiffness);
  polynomial_.force_and_stiffness(q, scratch_, force, expected);
  EXPECT_EQ(stiffness, expected);
  internal_force.stiffness(q, Tangent::kPositiveSemidefinite, workspace, stiffness);
  elasticity_.stiffness(q, Tangent::kPositiveSemidefinite, elasticity_scratch_, expected);
  EXPECT_EQ(stiffness, expected);
}

}  // namespace
}  // namespace exmat::runtime
