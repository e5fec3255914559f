#include "runtime/sim/step/attachment.h"

#include <Eigen/Geometry>
#include <cmath>
#include <gtest/gtest.h>

#include "common/core/decompositions.h"
#include "runtime/sim/space/full/full_response.h"
#include "runtime/sim/step/contact_step.h"
#include "runtime/sim/step/impulse_response.h"
#include "runtime/sim/world/world.h"
#include "tests/precompute/full_space/full_space_bar.h"
#include "tests/support/allocation_counter.h"

// Patches of a bar that a frame holds, in all vertices and in all modes, which are the same: beside a bar whose
// vertices are fixed, beside each other, and beside the balance of forces.
namespace exmat::precompute {
namespace attachment_test {

constexpr double kTight = 1e-9;  // of Newton's method

struct AttachedBar {
  explicit AttachedBar(bool free, bool modes = false, double youngs_modulus = 1e5)
      : bar(complete_bar({.cells = {4, 1, 1}, .youngs_modulus = youngs_modulus, .free = free})), in_modes(modes) {
    model = std::move(runtime::build_model(bar.model, {.examples = false}).model);
    full = std::move(runtime::build_full_model(bar.model, *model).model);
    state = runtime::make_state(*model);
    runtime::prepare_full(*full, state);
    if (!in_modes) runtime::enter_full_space(*full, *model, state);
    scene.time_step = 0.004;
    scene.newton = scene.space.newton = {100, kTight};
    scene.space.space = in_modes ? Space::kReduced : Space::kFull;
    scene.gravity = {0, -9, 3};
    scene.gravity_force = runtime::gravity_force(*model, scene.gravity);
  }

  /// Holds the vertices of the bar's first end, or of its last.
  runtime::Attachment& attach(AttachmentKind kind, bool last = false) {
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
    if (in_modes) {
      RowMatrix rows(3 * std::ssize(held), model->modes());
      VertexArray places(std::ssize(held), 3);
      for (Eigen::Index k = 0; k < places.rows(); ++k) {
        const Eigen::Index v = held[static_cast<std::size_t>(k)];
        rows.middleRows<3>(3 * k) = bar.basis().middleRows<3>(3 * v);
        places.row(k) = rest().row(v) - model->frame->origin().transpose();
      }
      attachment.patch = runtime::reduce_patch(places, rows, attachment.shares, attachment.places,
                                               attachment.kind == AttachmentKind::kFixed);
      attachment.mean = attachment.mean_before = runtime::mean_of(attachment, runtime::pose_of(*model, state));
    }
    state.attachments.push_back(attachment);
    if (in_modes) {
      if (!workspace) workspace.emplace(*model, scene);
      workspace->fit(*model, scene, state.attachments);
    }
    return state.attachments.back();
  }

  void step() {
    if (!workspace) workspace.emplace(*model, scene);
    if (in_modes) {
      ASSERT_EQ(runtime::step(*model, scene, state, *workspace).status, 0U);
      return;
    }
    if (!own) own.emplace(*full, scene);
    ASSERT_EQ(runtime::step_in_full_space(*full, *model, scene, state, *workspace, *own).status, 0U);
  }

  const VertexArray& rest() const { return bar.model.object->mesh.vertices; }
  Eigen::Vector3d position(Eigen::Index v) const {
    const Eigen::Vector3d u = bar.basis().middleRows<3>(3 * v) * state.q;
    if (in_modes) return model->frame->placement(state.frame).to_world(rest().row(v).transpose() + u);
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

  double energy() const { return runtime::energies(full.get(), *model, scene, state).total(); }

  test::Bar bar;
  bool in_modes;
  std::unique_ptr<const runtime::Model> model;
  std::unique_ptr<const runtime::FullModel> full;
  runtime::StepScene scene;
  runtime::State state;
  std::optional<runtime::Workspace> workspace;
  std::optional<runtime::FullWorkspace> own;
};

// Conjugate gradients in single precision, among what is projected away, beside a dense factor under conditions.
TEST(Attachment, HoldsAgainstImpulsesAsInAllModes) {
  for (const auto kind : {AttachmentKind::kFixed, AttachmentKind::kBall, AttachmentKind::kSpring}) {
    AttachedBar body(true), modes(true, true);
    for (AttachedBar* const one : {&body, &modes}) {
      runtime::Attachment& attachment = one->attach(kind);
      attachment.stiffness = 2000;
      attachment.damping = 3;
      one->step();
    }
    const Eigen::Index tip = body.rest().rows() - 1;
    const RowMatrix rows = modes.bar.basis().middleRows<3>(3 * tip);
    const VertexArray rest = modes.rest().row(tip);
    runtime::ImpulseResponse reference(*modes.model, modes.scene, modes.state);
    reference.update(modes.scene.time_step, runtime::Tangent::kExact);
    const Eigen::MatrixXd J = reference.jacobian({rest, rows});
    const Eigen::Matrix3d expected = J * reference.solve(J.transpose());
    runtime::FullImpulseResponse response(*body.full, *body.model, body.scene, body.state, *body.workspace, *body.own);
    const IndexMatrix corners = IndexMatrix::Constant(1, 1, static_cast<std::int32_t>(tip));
    const RowMatrix shares = RowMatrix::Ones(1, 1);
    EXPECT_LE((response.compliance({corners, shares}) - expected).norm(), 1e-4 * expected.norm());
    const runtime::Attachment& held = body.state.attachments.front();
    const Eigen::Vector3d before = body.mean(held);
    response.apply({corners, shares}, Eigen::Vector3d(0, 1, 2));
    if (kind != AttachmentKind::kSpring) {
      EXPECT_LE((body.mean(held) - before).norm(), 1e-12);
    }
  }
}

// Held vertices are eliminated in the one and projected away in the other.
TEST(Attachment, OfAFixedPatchIsAClamp) {
  AttachedBar clamped(false), held(true);
  held.attach(AttachmentKind::kFixed);
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
  for (const auto kind : {AttachmentKind::kFixed, AttachmentKind::kBall}) {
    AttachedBar body(true);
    runtime::Attachment& attachment = body.attach(kind);
    for (int i = 1; i <= 100; ++i) {
      const double time = 0.004 * i;
      attachment.rotation = Eigen::AngleAxisd(20 * time, Eigen::Vector3d(1, 2, 0).normalized());
      attachment.position = Eigen::Vector3d(0, 10 * time, 0);
      body.step();
      EXPECT_LE((body.mean(attachment) - attachment.anchor()).norm(), 1e-12 * (1 + 10 * time)) << i;
      if (kind == AttachmentKind::kBall) continue;
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
  for (const auto kind : {AttachmentKind::kFixed, AttachmentKind::kBall, AttachmentKind::kSpring}) {
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

/// Hangs a bar by both ends, else it would swing, which nothing damps, and expects that it weighs on the frames.
void expect_weight(AttachedBar& body, AttachmentKind kind) {
  body.scene.stiffness_damping = 0.02;
  body.scene.mass_damping = 4;
  body.attach(kind);
  body.attach(AttachmentKind::kFixed, /*last=*/true);
  auto& held = body.state.attachments;
  for (runtime::Attachment& one : held) {
    one.stiffness = 5000;
    one.damping = 100;
  }
  for (int i = 0; i < 3000; ++i) body.step();
  EXPECT_LE((held[0].force + held[1].force - body.weight()).norm(), 1e-6 * body.weight().norm());
  if (kind == AttachmentKind::kSpring)
    EXPECT_LE((body.mean(held[0]) - held[0].anchor() - held[0].force / 5000).norm(), 1e-7);
}

// Hanging bodies weigh on the frame, a spring is as long as its stiffness says, and a weaker hold lets go.
TEST(Attachment, BearsTheWeightOfWhatHangs) {
  for (const auto kind : {AttachmentKind::kFixed, AttachmentKind::kBall, AttachmentKind::kSpring}) {
    AttachedBar body(true);
    expect_weight(body, kind);
    auto& held = body.state.attachments;
    held[0].break_force = 0.1 * held[0].force.norm();
    body.step();
    EXPECT_TRUE(held[0].broken);
    for (int i = 0; i < 50; ++i) body.step();
    EXPECT_EQ(held[0].force.norm(), 0);
    EXPECT_GE((body.mean(held[0]) - held[0].anchor()).norm(), 0.05);
  }
}

// A broken attachment holds nothing: the body falls freely, its momentum changes by its weight alone, and in space
// `auto` it leaves the full space.
TEST(Attachment, ThatBrokeLetsTheBodyFly) {
  AttachedBar body(true);
  body.scene.mass_damping = 3;
  body.attach(AttachmentKind::kFixed).break_force = 1e-6;
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

/// The rotation of the frame that fits the vertices of a patch best (Kabsch 1976).
Eigen::Matrix3d fitted_rotation(const AttachedBar& body, const runtime::Attachment& attachment) {
  const Eigen::Vector3d mean = body.mean(attachment), own = attachment.places * attachment.shares;
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  for (std::size_t k = 0; k < attachment.vertices.size(); ++k) {
    const auto at = static_cast<Eigen::Index>(k);
    sum += attachment.shares[at] * (body.position(attachment.vertices[k]) - mean) *
           (attachment.places.col(at) - own).transpose();
  }
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(sum, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const double sign = (svd.matrixU() * svd.matrixV().transpose()).determinant();
  return svd.matrixU() * Eigen::Vector3d(1, 1, sign).asDiagonal() * svd.matrixV().transpose();
}

TEST(AttachmentInModes, HoldsExactlyWhereTheFrameIs) {
  for (const bool free : {true, false})
    for (const auto kind : {AttachmentKind::kFixed, AttachmentKind::kBall}) {
      AttachedBar body(free, /*modes=*/true, 1e7);
      const double speed = free ? 10 : 0.2, spin = free ? 20 : 1;  // what is clamped does not go far
      const double rise = 0.1;                                     // [s] until it goes so fast
      runtime::Attachment& attachment = body.attach(kind, /*last=*/true);
      const Eigen::Vector3d about = body.mean(attachment);
      for (int i = 1; i <= 100; ++i) {
        const double time = 0.004 * i - rise * (1 - std::exp(-0.004 * i / rise));
        attachment.rotation = Eigen::AngleAxisd(spin * time, Eigen::Vector3d(1, 2, 0).normalized());
        attachment.position = about - attachment.rotation * about + Eigen::Vector3d(0, speed * time, 0);
        body.step();
        EXPECT_LE((body.mean(attachment) - attachment.anchor()).norm(), 1e-10 * body.bar.length) << i;
        if (kind == AttachmentKind::kBall) continue;
        EXPECT_LE((fitted_rotation(body, attachment) - attachment.rotation).norm(), 1e-10) << i;
      }
    }
}

// BDF2 of the momenta that the vertices have, as the masses of the mesh sum them up, in a step of a body that is held
// twice.
TEST(AttachmentInModes, ExertsWhatTheMomentaSay) {
  for (const auto kind : {AttachmentKind::kFixed, AttachmentKind::kBall, AttachmentKind::kSpring}) {
    AttachedBar body(true, /*modes=*/true);
    body.scene.newton.tolerance = 1e-11;
    body.attach(AttachmentKind::kBall, /*last=*/true);
    body.attach(kind);
    auto& held = body.state.attachments;
    held[1].stiffness = 3000;
    held[1].damping = 20;
    Eigen::Vector3d linear[3], angular[3];
    for (int i = 0; i <= 60; ++i) {
      const runtime::FreeState& free = runtime::free_state(body.state);
      linear[2] = free.linear_momentum;
      angular[2] = free.angular_momentum;
      if (i >= 2) {
        const Eigen::Vector3d rate = (3 * linear[2] - 4 * linear[1] + linear[0]) / 0.008;
        const Eigen::Vector3d turn = (3 * angular[2] - 4 * angular[1] + angular[0]) / 0.008;
        const Eigen::Vector3d centre = body.model->frame->placement(body.state.frame).position;
        Eigen::Vector3d force = body.weight(), torque = Eigen::Vector3d::Zero();
        double size = 0;
        for (const runtime::Attachment& one : held) {
          force -= one.force;
          // A damper's force on the frame acts at the anchor, and on the body at the mean.
          torque -= one.torque + (one.position + body.mean(one) - one.anchor() - centre).cross(one.force);
          size += one.force.norm();
        }
        EXPECT_LE((rate - force).norm(), 1e-9 * size) << static_cast<int>(kind) << i;
        EXPECT_LE((turn - torque).norm(), 1e-9 * size * body.bar.length) << static_cast<int>(kind) << i;
      }
      linear[0] = linear[1];
      angular[0] = angular[1];
      linear[1] = linear[2];
      angular[1] = angular[2];
      held[1].position = Eigen::Vector3d(0, 0.05 * std::sin(0.1 * i), 0.002 * i);
      body.step();
    }
  }
}

// In all modes a body is what it is in all vertices. Pendulums: a soft one on a ball, and one on a spring with a
// damper.
TEST(AttachmentInModes, SwingsAsInAllVertices) {
  for (const auto kind : {AttachmentKind::kBall, AttachmentKind::kSpring}) {
    AttachedBar modes(true, /*modes=*/true), vertices(true);
    double off = 0, size = 0, gained = 0;
    for (AttachedBar* const body : {&modes, &vertices}) {
      runtime::Attachment& attachment = body->attach(kind);
      attachment.stiffness = 2e4;
      attachment.damping = 200;
    }
    const double start = modes.energy();
    double lowest = start;
    for (int i = 0; i < 500; ++i) {
      modes.step();
      vertices.step();
      gained = std::max(gained, std::abs(modes.energy() - vertices.energy()));
      lowest = std::min(lowest, runtime::energies(*modes.model, modes.scene, modes.state).potential);
      for (Eigen::Index v = 0; v < modes.rest().rows(); ++v) {
        off = std::max(off, (modes.position(v) - vertices.position(v)).norm());
        size = std::max(size, (modes.position(v) - modes.rest().row(v).transpose()).norm());
      }
    }
    EXPECT_GE(size, 1);
    EXPECT_LE(off, 0.01 * size) << static_cast<int>(kind);
    EXPECT_LE(gained, 0.01 * (start - lowest)) << static_cast<int>(kind);
  }
}

// The bar beyond a ball and a clamp comes to rest where it does in all vertices; so does one that a single vertex
// holds.
TEST(AttachmentInModes, RestsAsInAllVertices) {
  AttachedBar modes(false, /*modes=*/true), vertices(false);
  for (AttachedBar* const body : {&modes, &vertices}) {
    body->scene.stiffness_damping = 0.05;
    runtime::Attachment& attachment = body->attach(AttachmentKind::kBall, /*last=*/true);
    for (int i = 0; i < 1500; ++i) {
      attachment.position = std::min(1.0, 0.01 * i) * Eigen::Vector3d(0.01, -0.03, 0.04);
      body->step();
    }
  }
  const double size = 0.05;
  for (Eigen::Index v = 0; v < modes.rest().rows(); ++v)
    EXPECT_LE((modes.position(v) - vertices.position(v)).norm(), 1e-6 * size) << v;
  const runtime::Attachment &own = modes.state.attachments[0], &other = vertices.state.attachments[0];
  EXPECT_LE((own.force - other.force).norm(), 1e-5 * other.force.norm());
  EXPECT_LE((own.torque - other.torque).norm(), 1e-5 * other.torque.norm());
}

TEST(AttachmentInModes, BearsTheWeightOfWhatHangsAndBreaks) {
  for (const auto kind : {AttachmentKind::kFixed, AttachmentKind::kBall, AttachmentKind::kSpring}) {
    AttachedBar body(true, /*modes=*/true);
    expect_weight(body, kind);
    auto& held = body.state.attachments;
    const double bears = 0.1 * held[0].force.norm();
    for (runtime::Attachment& one : held) one.break_force = bears;
    body.step();
    EXPECT_TRUE(held[0].broken && held[1].broken);
    const auto linear = [&] { return body.model->frame->momenta(body.state.frame)->linear; };
    const Eigen::Vector3d before = linear();
    for (int i = 0; i < 50; ++i) body.step();
    const Eigen::Vector3d expected = 50 * body.scene.time_step * body.weight();
    EXPECT_LE((linear() - before - expected).norm(), 1e-12 * expected.norm());
  }
}

// Bodies of one model that nothing holds go side by side, and a held one does what it does alone.
TEST(AttachmentInModes, IsTheSameAmongOthers) {
  AttachedBar alone(true, /*modes=*/true), many(true, /*modes=*/true);
  alone.attach(AttachmentKind::kFixed);
  std::vector<runtime::State> states(9, many.state);
  states[3].attachments = alone.state.attachments;
  runtime::World world({});
  for (runtime::State& state : states) world.add({many.model.get(), &many.scene}, state);
  world.fit_attachments(3);
  for (int i = 0; i < 50; ++i) {
    alone.step();
    world.step(1);
  }
  EXPECT_EQ(states[3].q, alone.state.q);
  EXPECT_EQ(states[3].attachments[0].force, alone.state.attachments[0].force);
  const double fallen = runtime::free_state(states[4]).position[1];
  EXPECT_NEAR(fallen, 0.5 * many.scene.gravity[1] * 0.2 * 0.2, 1e-6);
}

TEST(AttachmentInModes, AllocatesNothingInAStep) {
  if (!test::AllocationCounter::works()) GTEST_SKIP();
  AttachedBar body(true, /*modes=*/true);
  body.attach(AttachmentKind::kFixed);
  body.attach(AttachmentKind::kSpring, /*last=*/true).stiffness = 100;
  body.step();
  const test::AllocationCounter counter;
  for (int i = 0; i < 20; ++i) body.step();
  EXPECT_EQ(counter.count(), 0U);
}

}  // namespace attachment_test
}  // namespace exmat::precompute
