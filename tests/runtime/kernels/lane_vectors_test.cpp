#include <Eigen/Core>
#include <gtest/gtest.h>

#include "runtime/kernels/aligned_array.h"
#include "tests/support/instruction_sets.h"
#include "tests/support/lanes.h"
#include "tests/support/random.h"

// Vectors and quadratic forms of kLanes bodies side by side, of every instruction set, against Eigen.

namespace exmat::runtime {
namespace {

using test::in_lanes;
using test::LaneRows;
using test::out_of_lanes;

constexpr double kRounding = 1e-13;  // of sums of a few hundred terms

LaneRows random_rows(Eigen::Index size, std::uint32_t seed) { return test::random_matrix(kLanes, size, seed); }

class LaneVectorsTest : public ::testing::TestWithParam<int> {
 protected:
  Eigen::Index modes() const { return GetParam(); }
};

INSTANTIATE_TEST_SUITE_P(Sizes, LaneVectorsTest, ::testing::Values(1, 2, 4, 7, 20, 30, 43));

TEST_P(LaneVectorsTest, SumsAndProductsAreThoseOfEachLane) {
  const LaneRows a = random_rows(modes(), 1), b = random_rows(modes(), 2);
  const Eigen::VectorXd constants = test::random_vector(modes(), 3);
  for (const Kernels* kernels : available()) {
    AlignedArray sum(modes() * kLanes), dot(kLanes), added = in_lanes(a), factor = in_lanes(b.leftCols(1));
    kernels->lanes_sum(modes(), in_lanes(a).data(), in_lanes(b).data(), sum.data());
    EXPECT_EQ(out_of_lanes(sum, modes()), a + b) << kernels->name;
    kernels->lanes_dot(modes(), in_lanes(a).data(), in_lanes(b).data(), dot.data());
    kernels->lanes_add_constants(modes(), constants.data(), factor.data(), added.data());
    EXPECT_LE((out_of_lanes(added, modes()) - (a + b.col(0) * constants.transpose())).norm(), kRounding * a.norm());
    for (Eigen::Index lane = 0; lane < kLanes; ++lane)
      EXPECT_NEAR(dot[lane], a.row(lane).dot(b.row(lane)), kRounding * a.row(lane).norm() * b.row(lane).norm());
  }
}

// Lanes that are not chosen keep their bits, whatever stands beside them.
TEST_P(LaneVectorsTest, TakesTheChosenAlone) {
  const LaneRows to = random_rows(modes(), 2);
  LaneRows from = random_rows(modes(), 1), chosen(kLanes, 1);
  chosen << 1, 0, 0, 1, 0, 1, 1, 0;
  from.row(1).setConstant(std::numeric_limits<double>::quiet_NaN());
  for (const Kernels* kernels : available()) {
    AlignedArray numbers = in_lanes(to);
    kernels->lanes_take(modes(), in_lanes(chosen).data(), in_lanes(from).data(), numbers.data());
    for (Eigen::Index lane = 0; lane < kLanes; ++lane)
      EXPECT_EQ(out_of_lanes(numbers, modes()).row(lane), (chosen(lane) != 0 ? from : to).row(lane)) << kernels->name;
  }
}

// A and its gradient as docs/step_in_detail.md, "The incremental potential", writes them, then the potential at x.
TEST_P(LaneVectorsTest, PreparesAndAssemblesTheQuadraticForm) {
  std::vector<Eigen::MatrixXd> K;
  for (std::uint32_t lane = 0; lane < kLanes; ++lane) {
    const Eigen::MatrixXd half = test::random_matrix(modes(), modes(), 10 + lane);
    K.push_back(half + half.transpose());
  }
  const AlignedArray stiffness = in_lanes(K, 0.0);
  std::vector<AlignedArray> of;  // start, external, velocity centre, acceleration centre, x, internal
  std::vector<LaneRows> rows;
  for (std::uint32_t i = 0; i < 6; ++i) {
    rows.push_back(random_rows(modes(), 30 + i));
    of.push_back(in_lanes(rows.back()));
  }
  std::vector<AlignedArray> numbers;  // c_v, c_a, alpha, beta
  std::vector<Eigen::VectorXd> factors;
  for (std::uint32_t i = 0; i < 4; ++i) {
    factors.push_back(test::random_vector(kLanes, 50 + i).cwiseAbs());
    numbers.push_back(in_lanes(LaneRows(factors.back())));
  }
  const LaneForm form{modes(),           of[0].data(),      of[1].data(),      of[2].data(),     of[3].data(),
                      numbers[0].data(), numbers[1].data(), numbers[2].data(), numbers[3].data()};
  for (const Kernels* kernels : available()) {
    AlignedArray offset(modes() * kLanes), quadratic(lane_triangle(modes())), linear(modes() * kLanes), trace(kLanes),
        gradient(modes() * kLanes), sums(kLaneSums * kLanes);
    kernels->lanes_prepare(form, stiffness.data(), offset.data(), quadratic.data(), linear.data(), trace.data());
    const LaneRows prepared = out_of_lanes(linear, modes());
    kernels->lanes_assemble(form, of[4].data(), quadratic.data(), linear.data(), of[5].data(), offset.data(),
                            gradient.data(), sums.data());
    for (Eigen::Index lane = 0; lane < kLanes; ++lane) {
      const double rate = factors[0][lane], inertia = factors[1][lane], alpha = factors[2][lane],
                   beta = factors[3][lane];
      const Eigen::MatrixXd& own = K[static_cast<std::size_t>(lane)];
      const auto vector = [&](std::size_t i) { return Eigen::VectorXd(rows[i].row(lane)); };
      const Eigen::MatrixXd damping = alpha * Eigen::MatrixXd::Identity(modes(), modes()) + beta * own;
      const Eigen::MatrixXd A = inertia * Eigen::MatrixXd::Identity(modes(), modes()) + rate * damping;
      const Eigen::VectorXd g =
          inertia * (vector(0) - vector(3)) + rate * damping * (vector(0) - vector(2)) - vector(1);
      const double scale = kRounding * (1 + A.norm()) * (1 + g.norm());
      EXPECT_NEAR(trace[lane], own.diagonal().cwiseAbs().sum(), scale);
      EXPECT_LE((Eigen::VectorXd(prepared.row(lane)) - g).norm(), scale) << kernels->name;
      for (Eigen::Index i = 0; i < modes(); ++i)
        for (Eigen::Index j = 0; j <= i; ++j) EXPECT_NEAR(quadratic[lane_entry(i, j) + lane], A(i, j), scale);
      const Eigen::VectorXd x = vector(4) - vector(0), residual = vector(5) + g + A * x;
      const double expected[kLaneSums] = {x.dot(A * x),
                                          g.dot(x),
                                          vector(5).squaredNorm(),
                                          (vector(4) - vector(3)).squaredNorm(),
                                          vector(4).squaredNorm(),
                                          residual.squaredNorm()};
      for (Eigen::Index k = 0; k < kLaneSums; ++k)
        EXPECT_NEAR(sums[k * kLanes + lane], expected[k], scale * (1 + x.squaredNorm()) * (1 + residual.norm())) << k;
      EXPECT_LE((Eigen::VectorXd(out_of_lanes(gradient, modes()).row(lane)) - residual).norm(), scale * (1 + x.norm()));
    }
  }
}

}  // namespace
}  // namespace exmat::runtime
