#include "runtime/sim/elasticity/stiffness_polynomial.h"

#include <algorithm>
#include <cmath>
#include <gtest/gtest.h>
#include <vector>

#include "runtime/sim/elasticity/reduced_elasticity.h"
#include "tests/support/instruction_sets.h"
#include "tests/support/lanes.h"
#include "tests/support/random.h"

// Against the sum over elements of one body at a time, with every instruction set.

namespace exmat::runtime {
namespace stiffness_polynomial_test {

constexpr double kRounding = 1e-13;

struct Elements {
  Elements(Eigen::Index modes, Eigen::Index count)
      : gradient(0.3 * test::random_matrix(9 * count, modes, 1)), volumes(test::random_vector(count, 2).cwiseAbs()) {
    for (Eigen::Index j = 0; j < count; ++j) lame.push_back({1.0 + static_cast<double>(j), 2.0});
  }

  StiffnessPolynomial polynomial() const {
    Eigen::VectorXd mu = volumes, lambda = volumes;
    for (Eigen::Index j = 0; j < volumes.size(); ++j) {
      mu[j] *= lame[static_cast<std::size_t>(j)].mu;
      lambda[j] *= lame[static_cast<std::size_t>(j)].lambda;
    }
    return {gradient, mu, lambda};
  }

  RowMatrix gradient;
  Eigen::VectorXd volumes;
  std::vector<LameParameters> lame;
};

double largest_difference(const Eigen::MatrixXd& expected, Eigen::Index lane, const AlignedArray& stiffness) {
  double found = 0;
  for (Eigen::Index i = 0; i < expected.rows(); ++i)
    for (Eigen::Index j = 0; j <= i; ++j)
      found = std::max(found, std::abs(stiffness[lane_entry(i, j) + lane] - expected(i, j)));
  return found;
}

// Below, at and above whole blocks of modes; poses from small ones to such whose strains are above one.
TEST(StiffnessPolynomial, IsTheSumOverTheElements) {
  for (const Eigen::Index modes : {1, 2, 3, 4, 5, 8, 11, 20, 31, 32}) {
    const Elements elements(modes, 7);
    const StiffnessPolynomial polynomial = elements.polynomial();
    const ReducedElasticity one(MaterialModel::kStVenantKirchhoff, elements.gradient, elements.volumes, elements.lame);
    ReducedElasticity::Workspace workspace = one.make_workspace();
    test::LaneRows q = test::random_matrix(kLanes, modes, 3);
    for (Eigen::Index lane = 0; lane < kLanes; ++lane) q.row(lane) *= std::pow(0.2, lane);
    const AlignedArray lanes = test::in_lanes(q);
    for (const Kernels* kernels : available()) {
      AlignedArray stiffness(lane_triangle(modes)), mixed(lane_triangle(modes));
      kernels->lanes_polynomial_stiffness(polynomial.arrays(), lanes.data(), stiffness.data());
      kernels->lanes_mixed_polynomial_stiffness(polynomial.arrays(), lanes.data(), mixed.data());
      double of_mixed = 0;
      for (Eigen::Index lane = 0; lane < kLanes; ++lane) {
        Eigen::MatrixXd expected = Eigen::MatrixXd::Zero(modes, modes);
        one.stiffness(q.row(lane).transpose(), Tangent::kExact, workspace, expected);
        EXPECT_LE(largest_difference(expected, lane, stiffness), kRounding * expected.norm())
            << kernels->name << ", r = " << modes << ", lane " << lane;
        const double difference = largest_difference(expected, lane, mixed);
        EXPECT_LE(difference, 2e-6 * expected.norm()) << kernels->name << ", r = " << modes << ", lane " << lane;
        of_mixed = std::max(of_mixed, difference / expected.norm());
      }
      EXPECT_GT(of_mixed, 1e-10) << kernels->name << ": it is not rounded";
    }
  }
}

// A lane's numbers are its own, to the last bit.
TEST(StiffnessPolynomial, NoLaneDependsOnTheOthers) {
  constexpr Eigen::Index kModes = 13;
  const Elements elements(kModes, 5);
  const StiffnessPolynomial polynomial = elements.polynomial();
  const test::LaneRows q = test::random_matrix(kLanes, kModes, 3);
  test::LaneRows turned = q;
  for (Eigen::Index lane = 0; lane < kLanes; ++lane) turned.row((lane + 3) % kLanes) = q.row(lane);
  for (const Precision precision : {Precision::kDouble, Precision::kMixed}) {
    AlignedArray stiffness(lane_triangle(kModes)), others(lane_triangle(kModes));
    polynomial.evaluate_lanes(test::in_lanes(q).data(), precision, stiffness.data());
    polynomial.evaluate_lanes(test::in_lanes(turned).data(), precision, others.data());
    for (Eigen::Index i = 0; i < kModes; ++i)
      for (Eigen::Index j = 0; j <= i; ++j)
        for (Eigen::Index lane = 0; lane < kLanes; ++lane)
          ASSERT_EQ(stiffness[lane_entry(i, j) + lane], others[lane_entry(i, j) + (lane + 3) % kLanes]);
  }
}

// Many elements by the polynomial, few by themselves.
TEST(StiffnessPolynomial, ServesWhereItTakesLess) {
  const auto flops = [](MaterialModel material, Eigen::Index modes, Eigen::Index count) {
    const Elements elements(modes, count);
    const ReducedElasticity elasticity(material, elements.gradient, elements.volumes, elements.lame);
    return elasticity.lanes_stiffness_flops() / elasticity.potential().stiffness_flops();
  };
  EXPECT_EQ(flops(MaterialModel::kStVenantKirchhoff, 20, 23),
            StiffnessPolynomial::flops(20) / (162.0 * 23 * 20 + 9.0 * 23 * 20 * 21));
  EXPECT_LT(flops(MaterialModel::kStVenantKirchhoff, 20, 23), 0.5);
  EXPECT_EQ(flops(MaterialModel::kStVenantKirchhoff, 20, 8), 1);
  EXPECT_EQ(flops(MaterialModel::kStVenantKirchhoff, kMostPolynomialModes + 1, 500), 1);
  EXPECT_EQ(flops(MaterialModel::kStableNeoHookean, 20, 23), 1);
}

}  // namespace stiffness_polynomial_test
}  // namespace exmat::runtime
