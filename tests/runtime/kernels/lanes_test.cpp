#include "tests/support/lanes.h"

#include <cmath>
#include <gtest/gtest.h>
#include <string>
#include <vector>

#include "common/core/decompositions.h"
#include "runtime/kernels/aligned_array.h"
#include "runtime/kernels/kernels.h"
#include "runtime/sim/elasticity/element_potential.h"
#include "tests/support/instruction_sets.h"
#include "tests/support/random.h"

// The kernels of kLanes bodies side by side, of every instruction set, against Eigen and against one body at a time.

namespace exmat::runtime {
namespace lanes_test {

using Shape = std::pair<int, int>;  // r, s

constexpr double kRounding = 1e-13;  // of sums of a few hundred terms

using test::in_lanes;
using test::out_of_lanes;
using Vectors = test::LaneRows;

/// A symmetric positive definite matrix for each lane.
std::vector<Eigen::MatrixXd> matrices(Eigen::Index n) {
  std::vector<Eigen::MatrixXd> found;
  for (std::uint32_t lane = 0; lane < kLanes; ++lane) {
    const Eigen::MatrixXd half = test::random_matrix(n, n, 10 + lane);
    found.push_back(half * half.transpose() + 0.1 * Eigen::MatrixXd::Identity(n, n));
  }
  return found;
}

class LanesTest : public ::testing::TestWithParam<Shape> {
 protected:
  LanesTest() : modes_(GetParam().first), elements_(GetParam().second) {
    gradient_ = 0.1 * RowMatrix(test::random_matrix(9 * elements_, modes_, 1));
    by_element_ = AlignedArray(padded(elements_) * 9 * padded(modes_));
    for (Eigen::Index row = 0; row < gradient_.rows(); ++row)
      for (Eigen::Index c = 0; c < modes_; ++c) by_element_[row * padded(modes_) + c] = gradient_(row, c);
    by_pair_ = AlignedArray(by_element_.size() / 2);
    const Eigen::Index block = 9 * padded(modes_);
    for (Eigen::Index i = 0; i < by_element_.size(); ++i)
      reinterpret_cast<float*>(by_pair_.data())[2 * (i / block / 2 * block + i % block) + i / block % 2] =
          static_cast<float>(by_element_[i]);
    arrays_ = {padded(elements_) / kLanes,
               modes_,
               padded(modes_),
               nullptr,
               by_element_.data(),
               reinterpret_cast<const float*>(by_pair_.data()),
               elements_};
    mu_ = in_lanes(test::random_matrix(kLanes, padded(elements_) / kLanes, 2).cwiseAbs());
    lambda_ = in_lanes(test::random_matrix(kLanes, padded(elements_) / kLanes, 3).cwiseAbs());
    q_ = test::random_matrix(kLanes, modes_, 4);
  }

  Eigen::Index modes_, elements_;
  RowMatrix gradient_;
  AlignedArray by_element_, by_pair_, mu_, lambda_;
  ElementArrays arrays_;
  Vectors q_;
};

// Below, at and above a block of modes and a pair of elements.
INSTANTIATE_TEST_SUITE_P(Sizes, LanesTest,
                         ::testing::Values(Shape{1, 1}, Shape{3, 2}, Shape{4, 5}, Shape{9, 8}, Shape{20, 23},
                                           Shape{30, 60}, Shape{42, 21}),
                         [](const auto& test) {
                           return "r" + std::to_string(test.param.first) + "s" + std::to_string(test.param.second);
                         });

TEST_P(LanesTest, ElementsAreThoseOfOneBodyAtATime) {
  const ElementPotential one(gradient_);
  ElementPotential::Workspace workspace = one.make_workspace();
  for (const MaterialModel model :
       {MaterialModel::kStVenantKirchhoff, MaterialModel::kStableNeoHookean, MaterialModel::kCorotational}) {
    ElementLaw law;
    law.kind = law_kind(model);
    AlignedArray mu(padded(elements_)), lambda(padded(elements_));
    for (Eigen::Index j = 0; j < elements_; ++j) mu[j] = mu_[j], lambda[j] = lambda_[j];
    law.mu = mu.data();
    law.lambda = lambda.data();
    const AlignedArray q = in_lanes(q_);
    for (const Kernels* kernels : available()) {
      AlignedArray energy(kLanes), force(modes_ * kLanes), force_alone(modes_ * kLanes), energy_alone(kLanes),
          stiffness(lane_triangle(modes_));
      kernels->lanes_force_and_stiffness(arrays_, law, q.data(), energy.data(), force.data(), stiffness.data());
      kernels->lanes_force(arrays_, law, q.data(), energy_alone.data(), force_alone.data());
      for (Eigen::Index i = 0; i < force.size(); ++i) EXPECT_EQ(force[i], force_alone[i]);
      for (Eigen::Index lane = 0; lane < kLanes; ++lane) {
        Eigen::VectorXd expected(modes_);
        Eigen::MatrixXd expected_stiffness = Eigen::MatrixXd::Zero(modes_, modes_);
        const double expected_energy =
            one.force_and_stiffness(law, q_.row(lane).transpose(), workspace, expected, expected_stiffness);
        EXPECT_NEAR(energy[lane], expected_energy, kRounding * expected_energy) << kernels->name;
        EXPECT_EQ(energy_alone[lane], energy[lane]);
        EXPECT_LE((out_of_lanes(force, modes_).row(lane).transpose() - expected).norm(), kRounding * expected.norm())
            << kernels->name;
        double difference = 0;
        for (Eigen::Index i = 0; i < modes_; ++i)
          for (Eigen::Index j = 0; j <= i; ++j)
            difference = std::max(difference, std::abs(stiffness[lane_entry(i, j) + lane] - expected_stiffness(i, j)));
        EXPECT_LE(difference, kRounding * expected_stiffness.norm()) << kernels->name;
      }
      kernels->lanes_energy(arrays_, law, q.data(), energy_alone.data());
      for (Eigen::Index lane = 0; lane < kLanes; ++lane)
        EXPECT_NEAR(energy_alone[lane], energy[lane], kRounding * energy[lane]) << kernels->name;
    }
  }
}

// Energy and force to the bit; the stiffness to single precision, of sums of 9 s products.
TEST_P(LanesTest, MixedStiffnessIsTheSameToSinglePrecision) {
  ElementLaw law;
  AlignedArray mu(padded(elements_)), lambda(padded(elements_));
  for (Eigen::Index j = 0; j < elements_; ++j) mu[j] = mu_[j], lambda[j] = lambda_[j];
  law.mu = mu.data();
  law.lambda = lambda.data();
  const AlignedArray q = in_lanes(q_);
  for (const MaterialModel model :
       {MaterialModel::kStVenantKirchhoff, MaterialModel::kStableNeoHookean, MaterialModel::kCorotational}) {
    law.kind = law_kind(model);
    for (const Kernels* kernels : available()) {
      AlignedArray energy(kLanes), force(modes_ * kLanes), stiffness(lane_triangle(modes_));
      AlignedArray mixed_energy = energy, mixed_force = force, mixed = stiffness;
      kernels->lanes_force_and_stiffness(arrays_, law, q.data(), energy.data(), force.data(), stiffness.data());
      kernels->lanes_force_and_mixed_stiffness(arrays_, law, q.data(), mixed_energy.data(), mixed_force.data(),
                                               mixed.data());
      for (Eigen::Index lane = 0; lane < kLanes; ++lane) {
        EXPECT_EQ(mixed_energy[lane], energy[lane]) << kernels->name;
        double difference = 0, size = 0;
        for (Eigen::Index i = 0; i < modes_; ++i) {
          EXPECT_EQ(mixed_force[i * kLanes + lane], force[i * kLanes + lane]) << kernels->name;
          for (Eigen::Index j = 0; j <= i; ++j) {
            const double expected = stiffness[lane_entry(i, j) + lane];
            difference = std::max(difference, std::abs(mixed[lane_entry(i, j) + lane] - expected));
            size = std::max(size, std::abs(expected));
          }
        }
        EXPECT_LE(difference, 2e-6 * size) << kernels->name;
        EXPECT_GT(difference, 0) << kernels->name << ": it is the same";
      }
    }
  }
}

TEST_P(LanesTest, CholeskySolvesEachLane) {
  const auto A = matrices(modes_);
  const AlignedArray numbers = in_lanes(A);
  for (const Kernels* kernels : available()) {
    AlignedArray factor = numbers, x = in_lanes(q_), product(modes_ * kLanes);
    kernels->lanes_cholesky(factor.data(), modes_);
    kernels->lanes_cholesky_solve(factor.data(), modes_, x.data());
    kernels->lanes_symmetric_product(numbers.data(), modes_, in_lanes(q_).data(), product.data());
    for (Eigen::Index lane = 0; lane < kLanes; ++lane) {
      const Eigen::MatrixXd& own = A[static_cast<std::size_t>(lane)];
      const Eigen::VectorXd right = q_.row(lane), found = out_of_lanes(x, modes_).row(lane);
      EXPECT_LE((own * found - right).norm(), kRounding * (own.norm() * found.norm() + right.norm())) << kernels->name;
      const Eigen::VectorXd expected = own * right;
      EXPECT_LE((out_of_lanes(product, modes_).row(lane).transpose() - expected).norm(),
                kRounding * own.norm() * right.norm())
          << kernels->name;
    }
  }
}

// A lane that fails says so at its last pivot, and leaves the others their bits.
TEST_P(LanesTest, ALaneThatIsNotPositiveDefiniteIsAlone) {
  auto A = matrices(modes_);
  const Eigen::Index bad = modes_ / 2;
  A[3](bad, bad) = -1;
  for (const Kernels* kernels : available()) {
    AlignedArray all = in_lanes(matrices(modes_)), without = in_lanes(A);
    kernels->lanes_cholesky(all.data(), modes_);
    kernels->lanes_cholesky(without.data(), modes_);
    for (Eigen::Index i = 0; i < modes_; ++i)
      for (Eigen::Index j = 0; j <= i; ++j)
        for (Eigen::Index lane = 0; lane < kLanes; ++lane)
          if (lane != 3) {
            EXPECT_EQ(all[lane_entry(i, j) + lane], without[lane_entry(i, j) + lane]) << kernels->name;
          }
    EXPECT_TRUE(std::isnan(without[lane_entry(modes_ - 1, modes_ - 1) + 3])) << kernels->name;
  }
}

TEST_P(LanesTest, OneMatrixServesAllLanes) {
  const Eigen::MatrixXd A = test::random_matrix(modes_ + 2, modes_, 5);
  for (const Kernels* kernels : available()) {
    AlignedArray product((modes_ + 2) * kLanes);
    kernels->lanes_matrix_product(A.data(), A.rows(), A.cols(), A.outerStride(), in_lanes(q_).data(), product.data());
    const Vectors expected = q_ * A.transpose();
    EXPECT_LE((out_of_lanes(product, modes_ + 2) - expected).norm(), kRounding * expected.norm() + 1e-15)
        << kernels->name;
  }
}

}  // namespace lanes_test
}  // namespace exmat::runtime
