#include "runtime/sim/step/attachment.h"

#include <Eigen/Geometry>
#include <cmath>
#include <gtest/gtest.h>

#include "runtime/sim/space/full/full_body.h"
#include "tests/precompute/full_space/full_space_bar.h"

// Patches of a free bar that a frame holds, beside a bar whose vertices are fixed, and beside the balance of forces.
namespace exmat::precompute {
namespace attachment_test {

constexpr double kTight = 1e-9;  // of Newton's method

struct AttachedBar {
  explicit AttachedBar(bool free) : bar(complete_bar({.cells = {4, 1, 1}, .free = free})) {
    model = std::move(runtime::build_model(bar.model, {.examples = false}).model);
    full = std::move(runtime::build_full_model(bar.model, *model).model);
    state = runtime::make_state(*model);
    runtime::prepare_full(*full, state);
    runtime::enter_full_space(*full, *model, state);
    scene.time_step = 0.004;
    scene.newton = scene.space.newton = {100, kTight};
    scene.space.space = Space::kFull;
    scene.gravity = {0, -9, 3};
    scene.gravity_force = runtime::gravity_force(*model, scene.gravity);
  }

  /// Holds the vertices of the bar's first end, or of its last.
  runtime::Attachment& attach(runtime::AttachmentKind kind, bool last = false) {
    runtime::Attachment attachment;
    attachment.kind = kind;
    const double at = last ? rest().col(0).maxCoeff() : rest().col(0).minCoeff();
    std::vector<Eigen::Index> held;
    for (Eigen::Index v = 0; v < rest().rows(); ++v)
      if (rest()(v, 0) == at) held.push_back(v);
    attachment.shares = Eigen::VectorXd::Constant(std::ssize(held), 1.0 / static_cast<double>(held.size()));
    attachment.places.resize(3, std::ssize(held));
    for (std::size_t k = 0; k < held.size(); ++k) {
      attachment.vertices.push_back(static_cast<std::int32_t>(held[k]));
      attachment.places.col(static_cast<Eigen::Index>(k)) = rest().row(held[k]);
    }
    state.attachments.push_back(attachment);
    return state.attachments.back();
  }

  void step() {
    if (!workspace) workspace.emplace(*model, scene);
    if (!own) own.emplace(*full, scene);
    ASSERT_EQ(runtime::step_in_full_space(*full, *model, scene, state, *workspace, *own).status, 0U);
  }

  const VertexArray& rest() const { return bar.model.object->mesh.vertices; }
  Eigen::Vector3d position(Eigen::Index v) const {
    return rest().row(v).transpose() +
           runtime::full_displacement(*full, model->frame->placement(state.frame), *state.full, v);
  }
  Eigen::Vector3d mean(const runtime::Attachment& attachment) const {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (std::size_t k = 0; k < attachment.vertices.size(); ++k)
      sum += attachment.shares[static_cast<Eigen::Index>(k)] * position(attachment.vertices[k]);
    return sum;
  }
  Eigen::Vector3d weight() const { return full->space.gravity_load().colwise().sum()[0] * scene.gravity; }

  test::Bar bar;
  std::unique_ptr<const runtime::Model> model;
  std::unique_ptr<const runtime::FullModel> full;
  runtime::StepScene scene;
  runtime::State state;
  std::optional<runtime::Workspace> workspace;
  std::optional<runtime::FullWorkspace> own;
};

// Held vertices are eliminated in the one and projected away in the other.
TEST(Attachment, OfAFixedPatchIsAClamp) {
  AttachedBar clamped(false), held(true);
  held.attach(runtime::AttachmentKind::kFixed);
  double off = 0, size = 0;
  for (int i = 0; i < 100; ++i) {
    clamped.step();
    held.step();
    for (Eigen::Index v = 0; v < clamped.rest().rows(); ++v) {
      off = std::max(off, (clamped.position(v) - held.position(v)).norm());
      size = std::max(size, (clamped.position(v) - clamped.rest().row(v).transpose()).norm());
    }
  }
  EXPECT_GE(size, 0.02);
  EXPECT_LE(off, 1e-6 * size);
}

TEST(Attachment, HoldsExactlyWhereTheFrameIs) {
  for (const auto kind : {runtime::AttachmentKind::kFixed, runtime::AttachmentKind::kBall}) {
    AttachedBar body(true);
    runtime::Attachment& attachment = body.attach(kind);
    for (int i = 1; i <= 100; ++i) {
      const double time = 0.004 * i;
      attachment.rotation = Eigen::AngleAxisd(20 * time, Eigen::Vector3d(1, 2, 0).normalized());
      attachment.position = Eigen::Vector3d(0, 10 * time, 0);
      body.step();
      EXPECT_LE((body.mean(attachment) - attachment.anchor()).norm(), 1e-12 * (1 + 10 * time)) << i;
      if (kind == runtime::AttachmentKind::kBall) continue;
      for (std::size_t k = 0; k < attachment.vertices.size(); ++k)
        EXPECT_LE((body.position(attachment.vertices[k]) - attachment.target(static_cast<Eigen::Index>(k))).norm(),
                  1e-12)
            << i;
    }
  }
}

// The forces on the body, its weight and what the frame exerts, change its linear momentum, which is summed here over
// all vertices with the velocities of the integrator.
TEST(Attachment, ExertsWhatTheMomentumSays) {
  for (const auto kind :
       {runtime::AttachmentKind::kFixed, runtime::AttachmentKind::kBall, runtime::AttachmentKind::kSpring}) {
    AttachedBar body(true);
    runtime::Attachment& attachment = body.attach(kind);
    attachment.stiffness = 3000;
    attachment.damping = 20;
    const ElasticSystem system = build_elastic_system(body.bar.model.object->mesh, body.bar.model.object->materials,
                                                      body.bar.model.object->fixed);
    const auto momentum = [&] {
      Eigen::Vector3d sum = Eigen::Vector3d::Zero();
      const Eigen::VectorXd own = body.full->space.momentum(body.state.full->v);
      for (Eigen::Index at = 0; at < own.size(); at += 3) sum += own.segment<3>(at);
      return sum;
    };
    Eigen::Vector3d before = momentum(), now = before;
    for (int i = 1; i <= 60; ++i) {
      attachment.position = Eigen::Vector3d(0, 0.2 * std::sin(0.1 * i), 0.01 * i);
      body.step();
      const Eigen::Vector3d after = momentum();
      const Eigen::Vector3d rate =
          i == 1 ? Eigen::Vector3d((after - now) / 0.004) : Eigen::Vector3d((3 * after - 4 * now + before) / 0.008);
      const Eigen::Vector3d expected = body.weight() - attachment.force;
      EXPECT_LE((rate - expected).norm(), 1e-6 * (rate.norm() + body.weight().norm())) << static_cast<int>(kind) << i;
      before = now;
      now = after;
    }
  }
}

// What hangs weighs on the frame, a spring is as long as its stiffness says, and what bears less lets go.
TEST(Attachment, BearsTheWeightOfWhatHangs) {
  for (const auto kind :
       {runtime::AttachmentKind::kFixed, runtime::AttachmentKind::kBall, runtime::AttachmentKind::kSpring}) {
    AttachedBar body(true);
    body.scene.stiffness_damping = 0.02;
    body.scene.mass_damping = 4;
    body.attach(kind);
    body.attach(runtime::AttachmentKind::kFixed, /*last=*/true);  // else it would swing, which nothing damps
    auto& held = body.state.attachments;
    for (runtime::Attachment& one : held) {
      one.stiffness = 5000;
      one.damping = 100;
    }
    for (int i = 0; i < 3000; ++i) body.step();
    EXPECT_LE((held[0].force + held[1].force - body.weight()).norm(), 1e-6 * body.weight().norm());
    if (kind == runtime::AttachmentKind::kSpring)
      EXPECT_LE((body.mean(held[0]) - held[0].anchor() - held[0].force / 5000).norm(), 1e-7);
    held[0].break_force = 0.1 * held[0].force.norm();
    body.step();
    EXPECT_TRUE(held[0].broken);
    for (int i = 0; i < 50; ++i) body.step();
    EXPECT_EQ(held[0].force.norm(), 0);
    EXPECT_GE((body.mean(held[0]) - held[0].anchor()).norm(), 0.05);
  }
}

// What broke holds nothing: the body falls freely, its momentum changes by its weight alone, and in space `auto` it
// leaves the full space.
TEST(Attachment, ThatBrokeLetsTheBodyFly) {
  AttachedBar body(true);
  body.scene.mass_damping = 3;
  body.attach(runtime::AttachmentKind::kFixed).break_force = 1e-6;
  for (int i = 0; i < 3; ++i) body.step();
  ASSERT_TRUE(body.state.attachments[0].broken);
  const auto linear = [&] { return body.model->frame->momenta(body.state.frame)->linear; };
  const Eigen::Vector3d before = linear();
  for (int i = 0; i < 50; ++i) body.step();
  const Eigen::Vector3d expected = 50 * body.scene.time_step * body.weight();
  EXPECT_LE((linear() - before - expected).norm(), 1e-12 * expected.norm());
  runtime::StepScene scene = body.scene;
  scene.space.space = Space::kAuto;
  scene.space.release = scene.time_step;
  EXPECT_FALSE(runtime::asks_for_full_space(scene, {}, body.state));
}

}  // namespace attachment_test
}  // namespace exmat::precompute
