#include <algorithm>
#include <cmath>
#include <gtest/gtest.h>
#include <memory>
#include <numbers>

#include "runtime/sim/step/stepper.h"
#include "tests/runtime/sim/step/thrown_block.h"
#include "tests/support/allocation_counter.h"
#include "tests/support/surfaces.h"

namespace exmat::runtime {
namespace mesh_step_test {

using test::mesh_of_box;
using test::ThrownBlock;

constexpr double kGravity = 9.81;

Eigen::Quaterniond turn(double angle, const Eigen::Vector3d& axis) {
  return Eigen::Quaterniond(Eigen::AngleAxisd(angle, axis.normalized()));
}

/// A block that falls, turns and comes to rest.
ThrownBlock tumbling(const Shape& ground, const RigidMotion& motion = RigidMotion()) {
  ThrownBlock block({ground, motion, 1e6, 2e3, 0.5}, 2e-3);
  block.gravity(kGravity);
  block.scene.stiffness_damping = 2e-3;
  FrameMotion start;
  start.position = Eigen::Vector3d(0, 0, 0.1);
  start.orientation = turn(0.4, {1, 2, 0.5});
  start.linear_velocity = Eigen::Vector3d(0.5, 0, -1);
  block.place(start);
  return block;
}

// The distance is that of the box to rounding, which falls, bounces and rests do not make large: contact takes energy.
TEST(MeshStep, OnABoxOfTrianglesABlockMovesAsOnTheBox) {
  const Box box{{0.2, 0.1, -0.3}, {1, 1, 0.3}, Eigen::Matrix3d::Identity()};
  ThrownBlock on_box = tumbling(box), on_mesh = tumbling(mesh_of_box(box, 3));
  Workspace box_workspace(*on_box.model, on_box.scene), mesh_workspace(*on_mesh.model, on_mesh.scene);
  int touching = 0;
  for (int i = 0; i < 1500; ++i) {
    touching += on_box.step(box_workspace).contacts;
    on_mesh.step(mesh_workspace);
  }
  EXPECT_GT(touching, 100);
  EXPECT_LE((on_box.position() - on_mesh.position()).norm(), 1e-9);
  EXPECT_LE((on_box.state.q - on_mesh.state.q).norm(), 1e-9 * on_box.state.q.norm());
}

// Slides with g (sin - mu cos) on a plane cut into cells, or stays.
TEST(MeshStep, SlidesOrStaysOnASlopeOfAHeightField) {
  constexpr double kSlope = 20 * std::numbers::pi / 180;
  RowMatrix heights(12, 160);
  for (int x = 0; x < heights.cols(); ++x) heights.col(x).setConstant(-std::tan(kSlope) * 0.1 * (x - 10));
  const HeightFieldShape hill{std::make_shared<HeightField>(heights, Eigen::Vector2d(0.1, 0.1)), {-1, -0.5, 0}};
  for (const double friction : {0.2, 0.8}) {
    ThrownBlock block({hill, RigidMotion(), 1e7, 2e4, friction}, 2e-3);
    block.gravity(kGravity);
    block.scene.mass_damping = 0;
    block.scene.stiffness_damping = 2e-3;
    FrameMotion start;
    start.orientation = turn(kSlope, Eigen::Vector3d::UnitY());
    start.position = Eigen::Vector3d(0, 0, 0.03);
    block.place(start);
    Workspace workspace(*block.model, block.scene);
    for (int i = 0; i < 300; ++i) block.step(workspace);
    const Eigen::Vector3d downhill(std::cos(kSlope), 0, -std::sin(kSlope)), there = block.position();
    const double velocity = block.velocity().dot(downhill);
    constexpr int kSteps = 600;
    for (int i = 0; i < kSteps; ++i) block.step(workspace);
    if (friction > std::tan(kSlope)) {
      EXPECT_LE((block.position() - there).norm(), 1e-4);
      EXPECT_LE(block.velocity().norm(), 1e-4);
    } else {
      const double expected = kGravity * (std::sin(kSlope) - friction * std::cos(kSlope));
      EXPECT_NEAR((block.velocity().dot(downhill) - velocity) / (kSteps * 2e-3), expected, 0.02 * expected);
    }
  }
}

// A mesh that goes up, along and round takes with it what lies on it, by friction.
TEST(MeshStep, AMovedMeshCarriesWhatLiesOnIt) {
  const Box table{{0.2, 0.1, -0.05}, {0.6, 0.6, 0.05}, Eigen::Matrix3d::Identity()};
  const RigidMotion motion(
      {{0.5, {0, 0, 0}, Eigen::Quaterniond::Identity()}, {2.5, {1, -0.5, 0.4}, turn(1, Eigen::Vector3d::UnitZ())}});
  ThrownBlock block({mesh_of_box(table, 2), motion, 1e6, 2e3, 0.9}, 2e-3);
  block.gravity(kGravity);
  block.scene.stiffness_damping = 2e-3;
  Workspace workspace(*block.model, block.scene);
  for (int i = 0; i < 250; ++i) block.step(workspace);
  const MotionSample before = motion.sample(0.5);
  const Eigen::Vector3d on_table = before.to_frame(block.centre());
  for (int i = 0; i < 1250; ++i) block.step(workspace);
  EXPECT_LE((motion.sample(3).to_frame(block.centre()) - on_table).norm(), 2e-3);
  EXPECT_LE(block.velocity().norm(), 1e-3);
}

TEST(MeshStep, AllocatesNothing) {
  if (!test::AllocationCounter::works()) GTEST_SKIP();
  ThrownBlock block = tumbling(mesh_of_box({{0.2, 0.1, -0.3}, {1, 1, 0.3}, Eigen::Matrix3d::Identity()}, 3));
  Workspace workspace(*block.model, block.scene);
  int touching = 0;
  const test::AllocationCounter allocations;
  for (int i = 0; i < 300; ++i) touching += block.step(workspace).contacts;
  EXPECT_EQ(allocations.count(), 0u);
  EXPECT_GT(touching, 0);
}

}  // namespace mesh_step_test
}  // namespace exmat::runtime
