#include <Eigen/Core>
#include <Eigen/LU>
#include <gtest/gtest.h>
#include <vector>

#include "runtime/kernels/aligned_array.h"
#include "tests/support/instruction_sets.h"
#include "tests/support/random.h"

// The rotation of one body against its formulas, written out with matrices (docs/step_in_detail.md, "Free bodies").

namespace exmat::runtime {
namespace rotation_kernels_test {

constexpr double kRounding = 1e-13;  // of sums of at most 50 terms, over their norms
constexpr int kFirst[6] = {0, 1, 2, 1, 0, 0}, kSecond[6] = {0, 1, 2, 2, 2, 1};

void write_panels(const Eigen::MatrixXd& matrix, Eigen::Index first, AlignedArray& panels) {
  for (Eigen::Index i = 0; i < matrix.rows(); ++i)
    for (Eigen::Index j = 0; j < matrix.cols(); ++j)
      panels[((first + i) / kLanes * matrix.cols() + j) * kLanes + (first + i) % kLanes] = matrix(i, j);
}

/// Random moments of so many modes, whose mass is the identity.
class RotationKernels : public testing::TestWithParam<int> {
 protected:
  RotationKernels() : panels(padded(5 * modes) * modes), turning(padded(3 * modes) * modes) {
    for (int pair = 0; pair < 6; ++pair) {
      const Eigen::MatrixXd half = test::random_matrix(modes, modes, static_cast<std::uint32_t>(pair));
      S.emplace_back(half + half.transpose());
    }
    S[0] = Eigen::MatrixXd::Identity(modes, modes) - S[1] - S[2];
    for (int pair = 1; pair < 6; ++pair) write_panels(S[static_cast<std::size_t>(pair)], (pair - 1) * modes, panels);
    for (int c = 0; c < 3; ++c) {
      const Eigen::MatrixXd half = test::random_matrix(modes, modes, static_cast<std::uint32_t>(10 + c));
      A.emplace_back(half - half.transpose());
      write_panels(-A.back(), c * modes, turning);
    }
    for (int c = 0; c < 3; ++c) {
      H.col(c) = -A[static_cast<std::size_t>(c)] * q;
      Av.col(c) = A[static_cast<std::size_t>(c)] * v;
      Ax.col(c) = A[static_cast<std::size_t>(c)] * x;
    }
  }

  RotationArrays arrays() const { return {modes, panels.data(), turning.data(), linear.data()}; }

  /// d(J w)/dq + d(H v)/dq, column by column of J w = tr(P) w - P w.
  Eigen::MatrixXd slope() const {
    Eigen::MatrixXd found = Av;
    for (int pair = 0; pair < 6; ++pair) {
      const Eigen::VectorXd dP = linear.col(pair) + 2 * S[static_cast<std::size_t>(pair)] * q;
      const int a = kFirst[pair], b = kSecond[pair];
      if (a == b) found += dP * w.transpose();
      found.col(a) -= dP * w[b];
      if (a != b) found.col(b) -= dP * w[a];
    }
    return found;
  }

  const Eigen::Index modes = GetParam();
  std::vector<Eigen::MatrixXd> S, A;
  const Eigen::MatrixXd linear = test::random_matrix(modes, 6, 20);
  const Eigen::VectorXd q = test::random_vector(modes, 21), v = test::random_vector(modes, 22),
                        x = test::random_vector(modes, 23);
  const Eigen::Vector3d w = test::random_vector(3, 24);
  const double rate = 1.7;
  Eigen::MatrixX3d H = Eigen::MatrixX3d(modes, 3), Av = H, Ax = H;
  AlignedArray panels, turning;
};

TEST_P(RotationKernels, MomentsAreThoseOfTheMatrices) {
  for (const Kernels* kernels : available())
    for (const bool centred : {false, true}) {
      AlignedArray products(rotation_products(modes)), centre(3 * modes);
      Eigen::VectorXd sums(6);
      kernels->rotation_moments(arrays(), q.data(), centred ? v.data() : nullptr, products.data(), centre.data(),
                                sums.data());
      for (int pair = 0; pair < 6; ++pair) {
        const Eigen::VectorXd Sq = S[static_cast<std::size_t>(pair)] * q;
        const Eigen::Map<const Eigen::VectorXd> found(products.data() + pair * modes, modes);
        EXPECT_LE((found - Sq).norm(), kRounding * (1 + Sq.norm())) << kernels->name << pair;
        EXPECT_NEAR(sums[pair], q.dot(linear.col(pair) + Sq), kRounding * (1 + Sq.norm() * q.norm()));
      }
      const Eigen::Map<const Eigen::MatrixX3d> turns(products.data() + rotation_turns(modes), modes, 3),
          others(centre.data(), modes, 3);
      EXPECT_LE((turns - H).norm(), kRounding * (1 + H.norm())) << kernels->name;
      EXPECT_LE((others + (centred ? 1 : 0) * Av).norm(), kRounding * (1 + Av.norm())) << kernels->name;
      Eigen::Vector3d h;
      kernels->rotation_dots(modes, H.data(), v.data(), h.data());
      EXPECT_LE((h - H.transpose() * v).norm(), kRounding * (1 + H.norm() * v.norm())) << kernels->name;
    }
}

TEST_P(RotationKernels, ForceIsThatOfTheMatrices) {
  const Eigen::VectorXd slopes = test::random_vector(6, 25);
  const Eigen::Vector3d by_velocity = test::random_vector(3, 26), by_pose = test::random_vector(3, 27);
  Eigen::VectorXd expected = -Av * by_velocity + H * by_pose;
  for (int pair = 0; pair < 6; ++pair)
    expected += slopes[pair] * (linear.col(pair) + 2 * S[static_cast<std::size_t>(pair)] * q);
  const Eigen::MatrixX3d velocity_products = -Av;
  for (const Kernels* kernels : available()) {
    AlignedArray products(rotation_products(modes));
    Eigen::VectorXd sums(6), force = Eigen::VectorXd::Constant(modes + 1, 5);
    kernels->rotation_moments(arrays(), q.data(), nullptr, products.data(), nullptr, sums.data());
    kernels->rotation_force(arrays(), products.data(), velocity_products.data(), slopes.data(), by_velocity.data(),
                            by_pose.data(), force.data());
    EXPECT_LE((force.head(modes) - expected).norm(), kRounding * (1 + expected.norm())) << kernels->name;
    EXPECT_EQ(force[modes], 5) << "written beyond the end";
  }
}

// The matrix that is added is checked with the numbers above the diagonal and around it, which stay as they are.
TEST_P(RotationKernels, StiffnessAndItsProductAreThoseOfTheMatrices) {
  const Eigen::Matrix3d half = test::random_matrix(3, 3, 28);
  const Eigen::Matrix3d inverse = (half * half.transpose() + Eigen::Matrix3d::Identity()).inverse();
  const Eigen::MatrixXd slopes = slope(), before = test::random_matrix(modes + 3, modes, 29);
  Eigen::MatrixXd expected = before;
  expected.topRows(modes).triangularView<Eigen::Lower>() +=
      slopes * inverse * slopes.transpose() - rate * rate * H * inverse * H.transpose();
  const Eigen::VectorXd product =
      rate * (slopes * inverse * H.transpose() - H * inverse * slopes.transpose()) * x - 2 * rate * Ax * w;
  const Eigen::MatrixX3d velocity_products = -Av;
  for (const Kernels* kernels : available()) {
    AlignedArray products(rotation_products(modes)), scratch(3 * modes);
    Eigen::MatrixXd factors(modes, 12), hessian = before;
    Eigen::VectorXd sums(6), found = Eigen::VectorXd::Constant(modes + 1, 5);
    kernels->rotation_moments(arrays(), q.data(), nullptr, products.data(), nullptr, sums.data());
    kernels->rotation_stiffness(arrays(), products.data(), velocity_products.data(), rate, w.data(), inverse.data(),
                                factors.data(), hessian.data(), hessian.outerStride());
    EXPECT_LE((hessian - expected).norm(), kRounding * expected.norm()) << kernels->name;
    EXPECT_EQ(hessian.bottomRows<3>(), before.bottomRows<3>()) << kernels->name;
    for (Eigen::Index j = 1; j < modes; ++j) EXPECT_EQ(hessian.col(j).head(j), before.col(j).head(j)) << kernels->name;
    kernels->rotation_product(arrays(), H.data(), factors.data(), rate, w.data(), x.data(), scratch.data(),
                              found.data());
    EXPECT_LE((found.head(modes) - product).norm(), kRounding * (1 + product.norm())) << kernels->name;
    EXPECT_EQ(found[modes], 5) << "written beyond the end";
  }
}

INSTANTIATE_TEST_SUITE_P(Modes, RotationKernels, testing::Values(1, 2, 3, 7, 8, 9, 12, 17, 20, 30, 42));

}  // namespace rotation_kernels_test
}  // namespace exmat::runtime
