#include "runtime/sim/frame/free_motion.h"

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "tests/support/random.h"
#include "tests/support/synthetic_model.h"

namespace exmat::runtime {
namespace {

double relative(const Eigen::MatrixXd& found, const Eigen::MatrixXd& expected) {
  return (found - expected).norm() / (1e-9 + expected.norm());
}

// By the blocks of the bundle, S_ab = U_a^T M U_b.
TEST(DeformingInertia, MomentsAreThoseOfTheirDefinition) {
  const test::Bar bar = test::make_bar({.free = true});
  const RigidData& rigid = *bar.model.rigid;
  const DeformingInertia inertia(rigid);
  const Eigen::Index r = inertia.modes();
  const Eigen::VectorXd q = 0.1 * test::random_vector(r, 1);
  DeformingInertia::Moments moments = inertia.make_moments();
  inertia.moments(q, moments);
  const auto S = [&](int a, int b) { return rigid.basis_moments.middleRows((3 * a + b) * r, r); };
  Eigen::Matrix3d P;
  for (int a = 0; a < 3; ++a)
    for (int b = 0; b < 3; ++b)
      P(a, b) = rigid.second_moments(a, b) + rigid.linear_moments.row(3 * a + b).dot(q) + q.dot(S(a, b) * q);
  EXPECT_LE(relative(moments.inertia, P.trace() * Eigen::Matrix3d::Identity() - P), 1e-13);
  for (int c = 0; c < 3; ++c) {
    const int a = (c + 1) % 3, b = (c + 2) % 3;
    EXPECT_LE(relative(moments.deformation().col(c), -(S(a, b) - S(b, a)) * q), 1e-13);
  }
}

// 1e-11: velocities are differences of poses, 1e3 times larger.
TEST(FreeMotion, OfACentreIsThatOfTheVelocity) {
  const test::Bar bar = test::make_bar({.free = true});
  const DeformingInertia inertia(*bar.model.rigid);
  constexpr double kRate = 750;
  FreeMotionWorkspace found(inertia), expected(inertia);
  for (const std::uint32_t centre_seed : {1U, 1U, 2U}) {
    const Eigen::VectorXd centre = 0.1 * test::random_vector(inertia.modes(), centre_seed),
                          q = centre + 1e-3 * test::random_vector(inertia.modes(), 3);
    FreeState body;
    body.spin = Eigen::Vector3d(1, -2, 3);
    body.angular_momentum = Eigen::Vector3d(3, 1, -2);
    begin_rotation(body, 0.002, false, found);
    begin_rotation(body, 0.002, false, expected);
    expected.velocity = kRate * (q - centre);
    ASSERT_TRUE(update_spin(inertia, q, expected));
    rotation_force(inertia, kRate, expected);
    ASSERT_TRUE(update_rotation(inertia, kRate, q, centre, found));
    EXPECT_LE(relative(found.solution.spin, expected.solution.spin), 1e-12);
    EXPECT_LE(relative(found.force, expected.force), 1e-11);
  }
}

TEST(Spin, KeepsTheAngularMomentumForAnyTurn) {
  const Eigen::Matrix3d inertia = Eigen::Vector3d(1, 2, 2.5).asDiagonal();
  for (const double speed : {0.0, 1e-6, 0.1, 3.0, 30.0, 150.0})
    for (const bool dissipative : {false, true}) {
      const double dt = 0.005;
      const Eigen::Vector3d before = speed * Eigen::Vector3d(0.5, 0.7, -0.4),
                            deformation = 0.01 * speed * Eigen::Vector3d(1, 0, -1);
      const SpinProblem problem{inertia * before + deformation,
                                dissipative ? Eigen::Vector3d::Zero() : Eigen::Vector3d(0.5 * dt * before),
                                dissipative ? dt : 0.5 * dt};
      const SpinSolution found = solve_spin(problem, inertia, deformation, 0.9 * before);
      ASSERT_TRUE(found.converged) << speed;
      EXPECT_LE((found.rotation - problem.offset - problem.factor * found.spin).norm(), 1e-15);
      const double angle = found.rotation.norm();
      const Eigen::Vector3d axis = angle > 0 ? Eigen::Vector3d(found.rotation / angle) : Eigen::Vector3d::UnitX();
      const Eigen::Matrix3d turn(Eigen::AngleAxisd(angle, axis));
      const Eigen::Vector3d momentum = turn * (inertia * found.spin + deformation);
      EXPECT_LE((momentum - problem.momentum).norm(), 1e-14 * problem.momentum.norm()) << speed;
      EXPECT_LE((rotation_of(found.rotation) - turn).norm(), 1e-15 * 4) << speed;
      EXPECT_LE((quaternion_of(found.rotation).toRotationMatrix() - turn).norm(), 1e-15 * 4) << speed;
    }
}

// The series of small turns and the functions beyond them meet.
TEST(Spin, RotationsAreExactOnBothSidesOfTheSeries) {
  for (const double angle : {1e-9, 1e-3, 0.0099999, 0.0100001, 0.0199999, 0.0200001, 0.1, 3.0}) {
    const Eigen::Vector3d axis = Eigen::Vector3d(2, -1, 3).normalized();
    const Eigen::Matrix3d turn(Eigen::AngleAxisd(angle, axis));
    EXPECT_LE((rotation_of(angle * axis) - turn).norm(), 1e-15) << angle;
    EXPECT_LE((quaternion_of(angle * axis).toRotationMatrix() - turn).norm(), 1e-15) << angle;
  }
}

}  // namespace
}  // namespace exmat::runtime
