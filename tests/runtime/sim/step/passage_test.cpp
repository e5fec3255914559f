#include <algorithm>
#include <cmath>
#include <gtest/gtest.h>
#include <memory>

#include "tests/runtime/sim/step/thrown_block.h"

namespace exmat::runtime {
namespace {

using test::mesh_of_box;
using test::ThrownBlock;

struct NamedWall {
  const char* name;
  Shape shape;
};
void PrintTo(const NamedWall& wall, std::ostream* stream) { *stream << wall.name; }

/// Walls across y and z whose near face is at x = 1, of this thickness.
Box wall(double thickness) {
  return {{1 + 0.5 * thickness, 0.1, 0.1}, {0.5 * thickness, 1, 1}, Eigen::Matrix3d::Identity()};
}

/// One square in triangles, as thick.
MeshShape shell(double thickness) {
  VertexArray vertices(4, 3);
  vertices << 0, -1, -1, 0, 1, -1, 0, 1, 1, 0, -1, 1;
  TriangleArray triangles(2, 3);
  triangles << 0, 1, 2, 0, 2, 3;
  return {std::make_shared<RigidMesh>(vertices, triangles, thickness), {1 + 0.5 * thickness, 0.1, 0.1}};
}

HeightFieldShape cliff() {
  Eigen::Matrix3d rotation;  // heights along -x
  rotation << 0, 0, -1, 1, 0, 0, 0, -1, 0;
  return {std::make_shared<HeightField>(RowMatrix::Zero(9, 9), Eigen::Vector2d(0.25, 0.25)), {1, -0.9, 1.1}, rotation};
}

std::vector<NamedWall> walls() {
  return {{"box_20mm", wall(0.02)},
          {"box_2mm", wall(0.002)},
          {"mesh_20mm", mesh_of_box(wall(0.02), 2)},
          {"mesh_2mm", mesh_of_box(wall(0.002), 2)},
          {"shell_20mm", shell(0.02)},
          {"shell_2mm", shell(0.002)},
          {"height_field", cliff()},
          {"sphere", Sphere{{1.8, 0.1, 0.1}, 0.8}},
          {"capsule", Capsule{{1.3, 0.1, -3}, {1.3, 0.1, 3}, 0.3}}};
}

class FastBody : public ::testing::TestWithParam<NamedWall> {};
INSTANTIATE_TEST_SUITE_P(Walls, FastBody, ::testing::ValuesIn(walls()),
                         [](const auto& wall) { return wall.param.name; });

// 50 m/s against a tenth of its size at 1/60 s, and more and less of each: no part of it ends on the far side, the
// momentum that it gets is that of the contacts, and no energy comes from anywhere.
TEST_P(FastBody, StaysOnItsSideOfTheWall) {
  for (const double time_step : {1.0 / 60, 1.0 / 240, 1e-3})
    for (const double speed : {3.0, 50.0, 200.0})
      for (const double stiffness : {1e6, 1e9}) {
        ThrownBlock block({GetParam().shape, RigidMotion(), stiffness, 0, 0}, time_step);
        // Round obstacles that are too soft to stop the body, that it would be far beyond in one step or does not meet
        // in the middle are gone round.
        const bool is_round = deepest(GetParam().shape) > 0.1 && std::isfinite(deepest(GetParam().shape));
        const double depth = speed * std::sqrt(block.mass() / 0.04 / stiffness);
        if (is_round && std::max(depth, speed * time_step / 4) > deepest(GetParam().shape)) continue;
        FrameMotion motion;
        motion.linear_velocity = Eigen::Vector3d(speed, 0, 0);
        if (!is_round)
          motion.orientation = Eigen::Quaterniond(Eigen::AngleAxisd(0.2, Eigen::Vector3d(0, 1, 0.5).normalized()));
        block.place(motion);
        Workspace workspace(*block.model, block.scene);
        const double energy = block.energy();
        const Eigen::Vector3d momentum = free_state(block.state).linear_momentum;
        Eigen::Vector3d impulse = Eigen::Vector3d::Zero();
        double highest = energy;
        int touching = 0;
        const auto steps = static_cast<int>(std::min(400.0, std::ceil(3 / speed / time_step) + 60));
        for (int i = 0; i < steps; ++i) {
          const StepReport report = block.step(workspace);
          ASSERT_FALSE(report.status & kStepNonFinite);
          impulse += time_step * report.contact_force;
          highest = std::max(highest, block.energy());
          touching += report.contacts;
        }
        const auto which = ::testing::Message() << time_step << " s, " << speed << " m/s, " << stiffness << " N/m^3";
        EXPECT_GT(touching, 0) << which;
        EXPECT_LT(block.velocity()[0], 0.05 * speed) << which;
        EXPECT_LT(block.centre()[0], 1.1) << which;
        EXPECT_LE((free_state(block.state).linear_momentum - momentum - impulse).norm(), 1e-10 * momentum.norm())
            << which;
        EXPECT_LE(highest, energy * (1 + 1e-6)) << which;
      }
}

// The same of a wall that comes to a body at rest.
TEST_P(FastBody, IsTakenAlongByAFastWall) {
  for (const double speed : {10.0, 50.0}) {
    const RigidMotion motion = RigidMotion::going_on(0, [&] {
      MotionSample sample;
      sample.linear_velocity = Eigen::Vector3d(-speed, 0, 0);
      return sample;
    }());
    ThrownBlock block({GetParam().shape, motion, 1e7, 0, 0}, 1.0 / 60);
    Workspace workspace(*block.model, block.scene);
    for (int i = 0; i < 60; ++i) ASSERT_FALSE(block.step(workspace).status & kStepNonFinite);
    EXPECT_LT(block.velocity()[0], -0.9 * speed);
  }
}

// Beside it a body flies on as if there were no wall, to the last bit.
TEST(Passage, BesideAWallNothingHappens) {
  for (const double gap : {0.05, 0.3}) {
    Box small = wall(0.02);
    small.half_extents.tail<2>().setConstant(0.3);
    small.centre[2] = 0.2 + 0.3 + gap;
    ThrownBlock block({small, RigidMotion(), 1e7, 0, 0}, 1.0 / 60);
    FrameMotion motion;
    motion.linear_velocity = Eigen::Vector3d(50, 0, 0);
    block.place(motion);
    Workspace workspace(*block.model, block.scene);
    for (int i = 0; i < 10; ++i) EXPECT_EQ(block.step(workspace).contacts, 0);
    EXPECT_EQ(block.velocity(), Eigen::Vector3d(50, 0, 0));
  }
}

}  // namespace
}  // namespace exmat::runtime
