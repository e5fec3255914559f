#include <cmath>
#include <gtest/gtest.h>
#include <optional>

#include "tests/runtime/sim/world/held_vertex.h"
#include "tests/runtime/sim/world/touching_blocks.h"

// Bodies in their modes that a host holds while they are carried, or lie on others.
namespace exmat::runtime {
namespace held_bodies_test {

TEST(HeldBody, ThatIsCarriedIsHeldBesideWhatCarriesIt) {
  const test::Bar bar = test::make_bar({.youngs_modulus = 1e6, .carried = true});
  const auto model = build_model(bar.model, {.carried = true}).model;
  StepScene scene;
  scene.time_step = 0.004;
  scene.gravity = {0, 0, -9.81};
  const Eigen::Quaterniond turned(Eigen::AngleAxisd(0.5, Eigen::Vector3d(0, 1, 1).normalized()));
  scene.carrier = RigidMotion({{0, Eigen::Vector3d::Zero()}, {0.4, {0.02, 0.03, -0.02}, turned}});
  scene.gravity_force = gravity_force(*model, scene.gravity);
  State state = make_state(*model);
  Workspace workspace(*model, scene);
  follow_frame(*model, scene, state, workspace);
  Eigen::Index tip = 0;
  bar.model.object->mesh.vertices.col(0).maxCoeff(&tip);
  state.attachments.push_back(test::held_vertex(*model, bar, state, tip, AttachmentKind::kFixed));
  workspace.fit(*model, scene, state.attachments);
  const Eigen::Vector3d place = state.attachments[0].places.col(0);
  double pulled = 0;
  for (int i = 1; i <= 100; ++i) {
    state.attachments[0].position[2] = 1e-3 * i;
    ASSERT_EQ(step(*model, scene, state, workspace).status, 0U) << i;
    const Eigen::Vector3d own =
        bar.model.object->mesh.vertices.row(tip).transpose() + bar.basis().middleRows<3>(3 * tip) * state.q;
    const Eigen::Vector3d here = model->frame->placement(state.frame).to_world(own);
    EXPECT_LE((here - place - state.attachments[0].position).norm(), 1e-10 * bar.length) << i;
    pulled = std::max(pulled, state.attachments[0].force.norm());
  }
  EXPECT_GE(pulled, 1);
}

// Backward Euler's change of the momentum of both: what a spring exerts on the upper, and their weights.
TEST(HeldBody, ThatLiesOnAnotherPullsAtItsSpring) {
  test::Blocks blocks(0.002);
  blocks.set_gravity(9.81);
  blocks.scene.newton.tolerance = 1e-10;
  World world({blocks.body(Eigen::Vector3d(0, 0, 0)), blocks.body(Eigen::Vector3d(0, 0, 0.2))},
              {.stiffness = 1e7, .damping = 100, .friction = 0.3});
  Eigen::Index top = 0;
  blocks.bar.model.object->mesh.vertices.rowwise().sum().maxCoeff(&top);
  State& upper = world.state(1);
  upper.attachments.push_back(test::held_vertex(*blocks.model, blocks.bar, upper, top, AttachmentKind::kSpring));
  upper.attachments[0].stiffness = 2000;
  upper.attachments[0].damping = 10;
  world.fit_attachments(1);
  int together = 0;
  const Eigen::Vector3d weight = 2 * blocks.mass() * blocks.scene.gravity;
  for (int i = 0; i < 100; ++i) {
    const Eigen::Vector3d before = test::momenta(blocks, world).linear;
    together += world.step(1).touching_pairs;
    ASSERT_EQ(world.report(1).status, 0U) << i;
    const Eigen::Vector3d rate = (test::momenta(blocks, world).linear - before) / blocks.scene.time_step;
    EXPECT_LE((rate - weight + upper.attachments[0].force).norm(), 1e-6 * weight.norm()) << i;
  }
  EXPECT_EQ(together, 100);
  EXPECT_GE(upper.attachments[0].force.norm(), 1);
}

/// A block whose lower corners a frame holds, below another one.
struct HeldBelow {
  explicit HeldBelow(AttachmentKind kind, const ContactLaw& law = {.stiffness = 1e7, .damping = 100, .friction = 0.3})
      : blocks(0.002) {
    blocks.set_gravity(9.81);
    blocks.scene.newton.tolerance = 1e-10;
    world.emplace(std::vector{blocks.body(Eigen::Vector3d(0, 0, 0)), blocks.body(Eigen::Vector3d(0, 0, 0.2))}, law);
    hold(*world, kind);
  }
  void hold(World& of, AttachmentKind kind) const {
    std::vector<Eigen::Index> corners;
    const VertexArray& rest = blocks.bar.model.object->mesh.vertices;
    for (Eigen::Index v = 0; v < rest.rows(); ++v)
      if (rest(v, 2) == 0 && (rest(v, 0) == 0 || rest(v, 0) == 0.4) && rest(v, 1) != 0.1) corners.push_back(v);
    of.state(0).attachments.push_back(test::held_patch(*blocks.model, blocks.bar, of.state(0), corners, kind));
    of.fit_attachments(0);
  }
  const Attachment& held() const { return world->state(0).attachments[0]; }

  test::Blocks blocks;
  std::optional<World> world;
};

// The frame is shaken at 10 m/s and turned at up to 20 rad/s. While they touch, backward Euler's change of the momentum
// of both is by the force on the frame and their weights.
TEST(HeldBody, ThatAnotherLiesOnGoesWithItsFrame) {
  for (const AttachmentKind kind : {AttachmentKind::kFixed, AttachmentKind::kBall})
    for (const bool is_moved : {false, true}) {
      SCOPED_TRACE(testing::Message() << "kind " << static_cast<int>(kind) << ", moved " << is_moved);
      HeldBelow bodies(kind);
      World& world = *bodies.world;
      const Eigen::Vector3d weight = 2 * bodies.blocks.mass() * bodies.blocks.scene.gravity;
      int together = 0;
      for (int i = 1; i <= 100; ++i) {
        const double t = is_moved ? i * bodies.blocks.scene.time_step : 0;
        Attachment& held = world.state(0).attachments[0];
        held.position = {0.05 * std::sin(200 * t), 0, 0.02 * t};
        held.rotation = Eigen::AngleAxisd(0.1 * std::sin(200 * t), Eigen::Vector3d(1, 2, 3).normalized());
        const Eigen::Vector3d before = test::momenta(bodies.blocks, world).linear;
        const int touching = world.step(1).touching_pairs;
        together += touching;
        ASSERT_EQ(world.report(0).status | world.report(1).status, 0U) << i;
        const BodyPose pose = pose_of(*bodies.blocks.model, world.state(0));
        EXPECT_LE((mean_of(held, pose) - held.anchor()).norm(), 1e-10 * 0.4) << i;
        if (kind == AttachmentKind::kFixed) {
          PatchPlace place;
          place_patch(held.patch, pose, place);
          EXPECT_LE((place.rotation - held.rotation).norm(), 1e-9) << i;
        }
        if (touching == 0) continue;
        const Eigen::Vector3d rate =
            (test::momenta(bodies.blocks, world).linear - before) / bodies.blocks.scene.time_step;
        EXPECT_LE((rate - weight + held.force).norm(), 1e-9 * (weight.norm() + held.force.norm())) << i;
      }
      EXPECT_GE(together, is_moved ? 10 : 100);
      if (!is_moved && kind == AttachmentKind::kFixed)  // it has come to rest
        EXPECT_LE((bodies.held().force - weight).norm(), 0.05 * weight.norm());
    }
}

// In one island with a body that it feels next to nothing of, as by itself.
TEST(HeldBody, StepsBesideAnotherAsAlone) {
  const ContactLaw nearly_none{.stiffness = 1e-9};
  HeldBelow bodies(AttachmentKind::kFixed, nearly_none);
  bodies.blocks.set_gravity(0);
  World alone({bodies.blocks.body(Eigen::Vector3d(0, 0, 0))}, nearly_none);
  bodies.hold(alone, AttachmentKind::kFixed);
  bodies.blocks.scene.integrator = Integrator::kBackwardEuler;
  int together = 0;
  for (int i = 1; i <= 20; ++i) {
    for (World* const world : {&*bodies.world, &alone})
      world->state(0).attachments[0].position[0] = 0.01 * std::sin(0.1 * i);
    together += bodies.world->step(1).touching_pairs;
    alone.step(1);
    const Eigen::VectorXd& q = alone.state(0).q;
    EXPECT_LE((bodies.world->state(0).q - q).norm(), 1e-9 * q.norm()) << i;
  }
  EXPECT_GE(together, 10);
}

// A load of 1 N is more than the frame bears. A spring without force holds the body from then on.
TEST(HeldBody, ThatAnotherLiesOnBreaksOff) {
  HeldBelow bodies(AttachmentKind::kFixed);
  State& below = bodies.world->state(0);
  below.attachments[0].break_force = 1;
  below.attachments.push_back(
      test::held_vertex(*bodies.blocks.model, bodies.blocks.bar, below, 1, AttachmentKind::kSpring));
  below.attachments[1].stiffness = 1e-9;
  bodies.world->fit_attachments(0);
  for (int i = 0; i < 50; ++i) bodies.world->step(1);
  EXPECT_TRUE(bodies.held().broken);
  EXPECT_EQ(bodies.held().force, Eigen::Vector3d::Zero());
  EXPECT_LE(bodies.blocks.centre(bodies.world->state(0))[2], 0.1 - 0.5 * 9.81 * 0.08 * 0.08);
}

}  // namespace held_bodies_test
}  // namespace exmat::runtime
