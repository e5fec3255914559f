#include "runtime/sim/frame/body_frame.h"

#include <gtest/gtest.h>

#include "runtime/sim/frame/world_vertices.h"
#include "runtime/sim/step/stepper.h"
#include "tests/support/random.h"
#include "tests/support/synthetic_model.h"

namespace exmat::runtime {
namespace {

using test::Bar;

/// A bar of each kind of frame in a scene with gravity, deformed and moving.
class Frames : public ::testing::TestWithParam<const char*> {
 protected:
  Frames() {
    const std::string kind = GetParam();
    const bool carried = kind == "carried";
    bar_ = test::make_bar({.free = kind == "free", .carried = carried});
    model_ = build_model(bar_.model, {.carried = carried}).model;
    scene_.time_step = 1e-3;
    scene_.gravity = Eigen::Vector3d(0, -9.81, 1);
    scene_.gravity_force = gravity_force(*model_, scene_.gravity);
    if (carried)
      scene_.carrier = RigidMotion({{0, Eigen::Vector3d::Zero()},
                                    {1, Eigen::Vector3d(0.3, 0.2, -0.1),
                                     Eigen::Quaterniond(Eigen::AngleAxisd(1.2, Eigen::Vector3d(1, 2, 2) / 3))}});
    const Eigen::VectorXd q = 0.1 * test::random_vector(model_->modes(), 1);
    state_ = make_state(*model_, q, 5 * test::random_vector(model_->modes(), 2));
    state_.time = 0.4;
    workspace_.emplace(*model_, scene_);
    frame().set_motion(motion(), state_.q, state_.v, workspace_->frame, state_.frame);
    follow_frame(*model_, scene_, state_, *workspace_);
  }
  const BodyFrame& frame() const { return *model_->frame; }
  static FrameMotion motion() {
    FrameMotion motion;
    motion.position = Eigen::Vector3d(1, 2, 3);
    motion.orientation = Eigen::Quaterniond(0.5, 0.1, -0.7, 0.3).normalized();
    motion.linear_velocity = Eigen::Vector3d(1, -2, 0.5);
    motion.angular_velocity = Eigen::Vector3d(2, -1, 3);
    return motion;
  }
  VertexArray field(const Eigen::VectorXd& coordinates) const {
    return (bar_.model.modal->basis * coordinates).reshaped<Eigen::RowMajor>(bar_.model.object->mesh.vertex_count(), 3);
  }
  /// World positions and velocities of all vertices.
  void world(VertexArray& x, VertexArray& velocity) const {
    x = bar_.model.object->mesh.vertices + field(state_.q);
    velocity = field(state_.v);
    to_world(frame().placement(state_.frame), frame().velocity(state_.frame), x, velocity);
  }

  Bar bar_;
  std::unique_ptr<const Model> model_;
  StepScene scene_;
  State state_;
  std::optional<Workspace> workspace_;
};

// Sums over the vertices with the mass matrix of the mesh, against moments and states of frames.
TEST_P(Frames, EnergiesAreThoseOfTheVertices) {
  VertexArray x, velocity;
  world(x, velocity);
  const Eigen::VectorXd v = velocity.reshaped<Eigen::RowMajor>();
  const VertexArray way = x - bar_.model.object->mesh.vertices;
  const Eigen::VectorXd down = scene_.gravity.replicate(x.rows(), 1);
  const Energies now = energies(*model_, scene_, state_);
  const double kinetic = 0.5 * v.dot(bar_.mass * v);
  EXPECT_NEAR(now.kinetic, kinetic, 1e-12 * kinetic);
  const double potential = -down.dot(bar_.mass * Eigen::VectorXd(way.reshaped<Eigen::RowMajor>()));
  EXPECT_NEAR(now.potential, potential, 1e-11 * std::abs(potential));
}

TEST_P(Frames, NumbersAreAllOfAState) {
  const std::vector<double> numbers = frame().numbers(state_.frame);
  FrameState other = frame().make_state();
  ASSERT_EQ(frame().numbers(other).size(), numbers.size());
  frame().set_numbers(numbers, other);
  EXPECT_EQ(frame().numbers(other), numbers);
  EXPECT_EQ(frame().placement(other).position, frame().placement(state_.frame).position);
  EXPECT_EQ(frame().placement(other).rotation, frame().placement(state_.frame).rotation);
  EXPECT_EQ(frame().kinetic_energy(state_.v, other), frame().kinetic_energy(state_.v, state_.frame));
}

TEST_P(Frames, MoveAsTheyAreToldOrSayThatTheyDoNot) {
  const std::string kind = GetParam();
  EXPECT_EQ(frame().moves(), kind != "clamped");
  EXPECT_EQ(frame().rigid_unknowns(), kind == "free" ? 6 : 0);
  EXPECT_EQ(frame().is_driven(), kind == "carried");
  EXPECT_EQ(set_motion(*model_, motion(), state_), kind == "free");
  if (kind != "free") return;
  const FrameMotion found = frame().motion(state_.frame), wanted = motion();
  EXPECT_EQ(found.position, wanted.position);
  EXPECT_LE(found.orientation.angularDistance(wanted.orientation), 1e-15);
  EXPECT_LE((found.linear_velocity - wanted.linear_velocity).norm(), 1e-15 * wanted.linear_velocity.norm());
  EXPECT_LE((found.angular_velocity - wanted.angular_velocity).norm(), 1e-14 * wanted.angular_velocity.norm());
}

// Vibration goes first, and leaves the momenta as they are; then they shrink, the linear one along what contacts gave.
TEST_P(Frames, LimitTheirKineticEnergy) {
  if (frame().is_driven()) return;
  const Energies before = energies(*model_, scene_, state_);
  const std::optional<FrameMomenta> momenta = frame().momenta(state_.frame);
  const Eigen::Vector3d impulse = momenta ? Eigen::Vector3d(0, 0.5 * momenta->linear[1], 0) : Eigen::Vector3d::Zero();
  State still = state_;
  still.v.setZero();
  const double none = momenta ? energies(*model_, scene_, still).kinetic : 0;  // another spin: near the rigid part
  for (const double allowed : {0.5 * (none + before.kinetic), 0.98 * none, 0.3 * before.kinetic, 0.0}) {
    State state = state_;
    const Eigen::Vector3d lost =
        frame().limit_kinetic_energy(allowed, impulse, workspace_->frame, state.v, state.frame);
    EXPECT_NEAR(energies(*model_, scene_, state).kinetic, allowed, 1e-12 * before.kinetic);
    EXPECT_LE(state.v.norm(), state_.v.norm());
    if (!momenta) continue;
    const FrameMomenta now = *frame().momenta(state.frame);
    EXPECT_LE((momenta->linear - now.linear - lost).norm(), 1e-15 * momenta->linear.norm());
    if (state.v.norm() > 0) {
      EXPECT_EQ(now.linear, momenta->linear);
      EXPECT_EQ(now.angular, momenta->angular);
    }
  }
}

// A force beside the centre of mass for one step: what frames make of it is Newton's second law, or nothing.
TEST_P(Frames, TakeForcesOfTheHost) {
  const std::optional<FrameMomenta> before = frame().momenta(state_.frame);
  if (!before) return;
  const Eigen::Vector3d force(3, -1, 2), torque(0.5, 0.25, -1);
  frame().apply(force, torque, state_.frame);
  step(*model_, scene_, state_, *workspace_);
  frame().clear_forces(state_.frame);
  const FrameMomenta after = *frame().momenta(state_.frame);
  const double dt = scene_.time_step;
  const Eigen::Vector3d gained = dt * (force + bar_.model.rigid->mass * scene_.gravity);
  EXPECT_LE((after.linear - before->linear - gained).norm(), 1e-15 * after.linear.norm());
  EXPECT_LE((after.angular - before->angular - dt * torque).norm(), 1e-13 * after.angular.norm());
  step(*model_, scene_, state_, *workspace_);
  EXPECT_LE((frame().momenta(state_.frame)->angular - after.angular).norm(), 1e-13 * after.angular.norm());
}

INSTANTIATE_TEST_SUITE_P(Kinds, Frames, ::testing::Values("clamped", "free", "carried"),
                         [](const auto& test) { return std::string(test.param); });

}  // namespace
}  // namespace exmat::runtime
