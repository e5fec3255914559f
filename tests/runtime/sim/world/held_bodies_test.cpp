#include <gtest/gtest.h>

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

}  // namespace held_bodies_test
}  // namespace exmat::runtime
