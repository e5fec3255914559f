#include "runtime/sim/lanes/lane_rotation.h"

#include <gtest/gtest.h>
#include <vector>

#include "tests/support/instruction_sets.h"
#include "tests/support/lanes.h"
#include "tests/support/random.h"
#include "tests/support/synthetic_model.h"

// The rotation of free bodies side by side against that of each by itself.

namespace exmat::runtime {
namespace lane_rotation_test {

constexpr double kTimeStep = 0.002, kRate = 1.5 / kTimeStep;

/// Bodies in poses of their own that turn faster from lane to lane.
struct Bodies {
  explicit Bodies(double fastest) : bar(test::make_bar({.free = true})), inertia(*bar.model.rigid) {
    const Eigen::Index modes = inertia.modes();
    q = 0.05 * test::random_matrix(kLanes, modes, 1);
    centre = q + 0.001 * test::random_matrix(kLanes, modes, 2);
    for (Eigen::Index lane = 0; lane < kLanes; ++lane) {
      FreeMotionWorkspace& own = each.emplace_back(inertia);
      FreeState state;
      state.spin = fastest * static_cast<double>(lane) / kLanes * Eigen::Vector3d(0.3, 0.9, 0.2).normalized();
      state.orientation = Eigen::Quaterniond(0.5, 0.5, -0.5, 0.5);
      own.velocity = kRate * (q.row(lane) - centre.row(lane)).transpose();
      inertia.moments(q.row(lane).transpose(), own.moments);
      state.angular_momentum =
          state.orientation * (own.moments.inertia * state.spin + own.moments.deformation().transpose() * own.velocity);
      state.spin *= 0.99;  // a guess
      begin_rotation(state, kTimeStep, lane % 2 == 0, own);
    }
  }

  test::Bar bar;
  DeformingInertia inertia;
  test::LaneRows q, centre;
  std::vector<FreeMotionWorkspace> each;
};

struct Found {
  explicit Found(Bodies& bodies, const LaneNumbers& active = LaneNumbers::Ones())
      : rotation(bodies.inertia),
        q(test::in_lanes(bodies.q)),
        centre(test::in_lanes(bodies.centre)),
        force(q.size()),
        product(q.size()) {
    const Eigen::Index modes = bodies.inertia.modes();
    for (Eigen::Index lane = 0; lane < kLanes; ++lane)
      rotation.set_problem(lane, bodies.each[static_cast<std::size_t>(lane)]);
    rotation.begin(LaneNumbers::Constant(kRate), LaneVectors(centre.data(), kLanes, modes));
    LaneVectors forces(force.data(), kLanes, modes);
    converged = rotation.update(active, LaneVectors(q.data(), kLanes, modes), forces);
  }

  LaneRotation rotation;
  AlignedArray q, centre, force, product;
  LaneNumbers converged;
};

/// Difference of a vector, relative to it.
double relative(const Eigen::VectorXd& found, const Eigen::VectorXd& expected) {
  return (found - expected).norm() / (expected.norm() + 1e-9);
}

// 1e-11: velocities are differences of poses, 1e3 times larger.
TEST(LaneRotation, IsThatOfEachBody) {
  for (const double fastest : {0.0, 3.0, 80.0}) {
    Bodies bodies(fastest);
    const Eigen::Index modes = bodies.inertia.modes();
    Found found(bodies);
    AlignedArray hessian(lane_triangle(modes));
    LaneVectors products(found.product.data(), kLanes, modes);
    found.rotation.add_stiffness(LaneNumbers::Ones(), hessian);
    found.rotation.gyroscopic_product(LaneVectors(found.q.data(), kLanes, modes), products);
    for (Eigen::Index lane = 0; lane < kLanes; ++lane) {
      FreeMotionWorkspace& own = bodies.each[static_cast<std::size_t>(lane)];
      const Eigen::VectorXd q = bodies.q.row(lane);
      ASSERT_TRUE(update_spin(bodies.inertia, q, own));
      EXPECT_EQ(found.converged[lane], 1);
      rotation_force(bodies.inertia, kRate, own);
      EXPECT_LE(relative(test::out_of_lanes(found.force, modes).row(lane), own.force), 1e-11) << fastest;
      Eigen::MatrixXd expected = Eigen::MatrixXd::Zero(modes, modes);
      add_rotation_stiffness(bodies.inertia, kRate, own, expected);
      double difference = 0;
      for (Eigen::Index i = 0; i < modes; ++i)
        for (Eigen::Index j = 0; j <= i; ++j)
          difference = std::max(difference, std::abs(hessian[lane_entry(i, j) + lane] - expected(i, j)));
      EXPECT_LE(difference, 1e-11 * expected.norm());
      gyroscopic_product(bodies.inertia, kRate, q, own);
      EXPECT_LE(relative(products.row(lane).matrix(), own.product.head(modes)), 1e-11);
      EXPECT_NEAR(found.rotation.gyroscopic_ratio()[lane], 2 * own.solution.spin.norm() / kRate, 1e-12);
      FreeMotionWorkspace taken(bodies.inertia);
      found.rotation.take(lane, taken);
      EXPECT_LE((taken.solution.spin - own.solution.spin).norm(), 1e-11 * (1 + own.solution.spin.norm()));
      EXPECT_LE((taken.solution.rotation - own.solution.rotation).norm(), 1e-13);
      EXPECT_LE((taken.moments.deformation() - own.moments.deformation()).norm(),
                1e-13 * own.moments.deformation().norm());
    }
  }
}

// The sine and cosine of the turn are series: rotations by up to a radian keep the angular momentum.
TEST(LaneRotation, KeepsTheAngularMomentum) {
  for (const double fastest : {1.0, 30.0, 300.0, 550.0}) {
    Bodies bodies(fastest);
    const Found found(bodies);
    for (Eigen::Index lane = 0; lane < kLanes; ++lane) {
      if (found.converged[lane] == 0) continue;
      FreeMotionWorkspace& own = bodies.each[static_cast<std::size_t>(lane)];
      const Eigen::Vector3d momentum = own.problem.momentum;
      found.rotation.take(lane, own);
      bodies.inertia.moments(bodies.q.row(lane).transpose(), own.moments);
      const Eigen::Vector3d now =
          own.moments.inertia * own.solution.spin + own.moments.deformation().transpose() * own.velocity;
      EXPECT_LE((rotation_of(own.solution.rotation) * now - momentum).norm(), 1e-13 * (1 + momentum.norm())) << fastest;
    }
  }
}

TEST(LaneRotation, LeavesFastTurnsToOthersAndIdleBodiesTheirSpin) {
  Bodies bodies(800);
  LaneNumbers active = LaneNumbers::Ones();
  active[2] = 0;
  const Found found(bodies, active);
  EXPECT_EQ(found.converged[1], 1);
  EXPECT_EQ(found.converged[2], 0);
  EXPECT_EQ(found.converged[7], 0) << "1.4 rad in a step";
  FreeMotionWorkspace own(bodies.inertia);
  found.rotation.take(2, own);
  EXPECT_EQ(own.solution.spin, bodies.each[2].solution.spin);
}

}  // namespace lane_rotation_test
}  // namespace exmat::runtime
