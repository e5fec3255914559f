#include <Eigen/LU>
#include <array>
#include <cmath>
#include <complex>
#include <functional>
#include <gtest/gtest.h>
#include <optional>

#include "common/core/decompositions.h"
#include "runtime/scene/attachment_loader.h"
#include "tests/runtime/sim/world/touching_blocks.h"

// Bodies in their modes that are attached to each other.
namespace exmat::runtime {
namespace attached_bodies_test {

using test::Blocks;

constexpr double kLength = 0.4;  // of a block, along x [m]
using Select = std::function<bool(const Eigen::Vector3d&)>;
const Select kEnd = [](const Eigen::Vector3d& x) { return x[0] > kLength - 1e-9; };
const Select kStart = [](const Eigen::Vector3d& x) { return x[0] < 1e-9; };
const Select kAll = [](const Eigen::Vector3d&) { return true; };

Patch patch_of(const Blocks& blocks, const Select& select) {
  const ObjectData& object = *blocks.bar.model.object;
  std::vector<std::int32_t> vertices;
  for (Eigen::Index i = 0; i < object.mesh.vertex_count(); ++i)
    if (select(object.mesh.vertices.row(i))) vertices.push_back(static_cast<std::int32_t>(i));
  RowMatrix rows(3 * std::ssize(vertices), blocks.model->modes());
  for (std::size_t k = 0; k < vertices.size(); ++k)
    rows.middleRows<3>(3 * static_cast<Eigen::Index>(k)) = blocks.bar.basis().middleRows<3>(3 * vertices[k]);
  return make_patch(object, std::move(vertices), std::move(rows));
}

struct Side {
  const Blocks& blocks;
  int body;
  Select select;
};

/// Attaches one to the other where both are; to be changed before the next step.
Attachment& attach(World& world, const Side& own, const Side& other, AttachmentKind kind) {
  const Patch patch = patch_of(own.blocks, own.select), holding = patch_of(other.blocks, other.select);
  const auto end_of = [&](const Side& side, const Patch& its_patch) {
    return End{*side.blocks.model, nullptr, side.blocks.scene, true, its_patch, world.state(side.body)};
  };
  Attachment attachment;
  attachment.kind = kind;
  attachment.stiffness = 1e5;
  attachment.damping = 10;
  const auto fault = hold_together(end_of(own, patch), end_of(other, holding), other.body, std::move(attachment),
                                   world.state(own.body));
  EXPECT_FALSE(fault) << fault->member << ": " << fault->found;
  return world.state(own.body).attachments.back();
}

/// World positions of a patch [3 x k].
Eigen::Matrix3Xd places(const World& world, const Side& side) {
  const Patch patch = patch_of(side.blocks, side.select);
  const State& state = world.state(side.body);
  const Placement at = side.blocks.model->frame->placement(state.frame);
  Eigen::Matrix3Xd here(3, patch.rest.rows());
  for (Eigen::Index k = 0; k < here.cols(); ++k)
    here.col(k) = at.to_world(patch.rest.row(k).transpose() + patch.basis_rows.middleRows<3>(3 * k) * state.q);
  return here;
}

struct Pose {
  Eigen::Vector3d mean;
  Eigen::Matrix3d rotation;
};

/// Mean by mass, and the rotation that fits a patch best from where it is at rest (Kabsch 1976).
Pose pose_of_patch(const World& world, const Side& side) {
  const Patch patch = patch_of(side.blocks, side.select);
  const Eigen::VectorXd shares = patch.masses / patch.masses.sum();
  const Eigen::Matrix3Xd here = places(world, side);
  const Eigen::Vector3d mean = here * shares, rest = patch.rest.transpose() * shares;
  Eigen::Matrix3d moment = Eigen::Matrix3d::Zero();
  for (Eigen::Index k = 0; k < here.cols(); ++k)
    moment += shares[k] * (here.col(k) - mean) * (patch.rest.row(k).transpose() - rest).transpose();
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(moment, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Vector3d signs(1, 1, 1);
  signs[2] = (svd.matrixU() * svd.matrixV().transpose()).determinant() > 0 ? 1 : -1;
  return {mean, svd.matrixU() * signs.asDiagonal() * svd.matrixV().transpose()};
}

/// How far a patch is from where it was in the frame of another: of its mean [m], and of its turn [rad].
struct Open {
  Open(const World& world, const Side& its_own, const Side& its_other)
      : own(its_own),
        other(its_other),
        own_start(pose_of_patch(world, own)),
        other_start(pose_of_patch(world, other)) {}
  double mean(const World& world) const {
    const Eigen::Vector3d start = own_start.mean - other_start.mean;
    const Pose now = pose_of_patch(world, other);
    return (pose_of_patch(world, own).mean - now.mean - now.rotation * other_start.rotation.transpose() * start).norm();
  }
  double turn(const World& world) const {
    return (pose_of_patch(world, own).rotation * own_start.rotation.transpose() -
            pose_of_patch(world, other).rotation * other_start.rotation.transpose())
        .norm();
  }
  Side own, other;
  Pose own_start, other_start;
};

class EachKind : public ::testing::TestWithParam<AttachmentKind> {};

INSTANTIATE_TEST_SUITE_P(, EachKind,
                         ::testing::Values(AttachmentKind::kFixed, AttachmentKind::kBall, AttachmentKind::kSpring),
                         [](const auto& info) { return std::string(name_of(info.param)); });

// Faces of two blocks that turn and swing stay on each other, without gravity: momenta are those of the start.
TEST_P(EachKind, KeepsMomentaOfFreeBodiesAndHolds) {
  const Blocks blocks(0.002);
  World world({blocks.body(Eigen::Vector3d(0, 0, 0), {0.3, 1, -0.2}, {1, 2, 3}),
               blocks.body(Eigen::Vector3d(kLength, 0, 0), {-0.1, -0.5, 0.4}, {0.5, -3, 1})},
              {.stiffness = 1e6});
  const Side own{blocks, 1, kStart}, other{blocks, 0, kEnd};
  attach(world, own, other, GetParam());
  const Open open(world, own, other);
  const test::Momenta start = test::momenta(blocks, world);
  double energy = world.energies().total();
  for (int i = 0; i < 500; ++i) {
    const WorldReport report = world.step(1);
    ASSERT_EQ(world.report(0).status, 0U) << i;
    EXPECT_EQ(report.largest_island, 2);
    if (GetParam() != AttachmentKind::kSpring) EXPECT_LE(open.mean(world), 1e-10 * kLength) << i;
    if (GetParam() == AttachmentKind::kFixed) EXPECT_LE(open.turn(world), 1e-10) << i;
    EXPECT_LE(world.energies().total(), energy * (1 + 1e-12)) << i;
    energy = world.energies().total();
  }
  const test::Momenta end = test::momenta(blocks, world);
  EXPECT_LE((end.linear - start.linear).norm(), 1e-12 * start.linear.norm());
  EXPECT_LE((end.angular - start.angular).norm(), 1e-12 * start.angular.norm());
}

// Two bodies that a spring pulls by their centres of mass: u = v + i w x, x their way against each other, w^2 = k (1/m
// + 1/m), goes by 1 / (1 - i w h) in a step of backward Euler.
TEST(AttachedBodies, OfASpringSwingAsTwoMasses) {
  const Blocks blocks(0.002);
  const double speed = 0.1, h = blocks.scene.time_step;
  World world({blocks.body(Eigen::Vector3d(0, 0, 0)), blocks.body(Eigen::Vector3d(0.7, 0, 0), {speed, 0, 0})},
              {.stiffness = 1e6});
  Attachment& spring = attach(world, {blocks, 1, kAll}, {blocks, 0, kAll}, AttachmentKind::kSpring);
  spring.damping = 0;
  const double w = std::sqrt(spring.stiffness * 2 / blocks.mass());
  std::complex<double> u(speed, 0);
  for (int i = 0; i < 500; ++i) {
    world.step(1);
    u /= std::complex<double>(1, -w * h);
    const Eigen::Vector3d apart = blocks.centre(world.state(1)) - blocks.centre(world.state(0));
    EXPECT_NEAR(apart[0] - 0.7, u.imag() / w, 1e-9 * speed / w) << i;
    EXPECT_NEAR(spring.force[0], spring.stiffness * (apart[0] - 0.7), 1e-9 * spring.stiffness * speed / w) << i;
  }
}

/// Blocks along x that hang from a clamped one, or from nothing.
struct Chain {
  Chain(double time_step, int links, const Eigen::Vector3d& gravity, AttachmentKind kind, double youngs_modulus = 1e6,
        double damping = 0)
      : clamped(time_step, options(false, youngs_modulus)), free(time_step, options(true, youngs_modulus)) {
    for (Blocks* const blocks : {&clamped, &free}) {
      blocks->scene.gravity = gravity;
      blocks->scene.gravity_force = gravity_force(*blocks->model, gravity);
      blocks->scene.stiffness_damping = damping;
      blocks->scene.newton.tolerance = 1e-9;
    }
    std::vector<WorldBodyStart> bodies;
    State top = make_state(*clamped.model);
    prepare_contacts(*clamped.model, 0, top);
    bodies.push_back({{clamped.model.get(), &clamped.scene, clamped.surface}, std::move(top)});
    for (int i = 1; i <= links; ++i) bodies.push_back(free.body(Eigen::Vector3d(i * kLength, 0, 0)));
    world = std::make_unique<World>(std::move(bodies), ContactLaw{.stiffness = 1e6});
    for (int i = 1; i <= links; ++i) attach(*world, {free, i, kStart}, {blocks(i - 1), i - 1, kEnd}, kind);
  }
  static test::BarOptions options(bool is_free, double youngs_modulus) {
    test::BarOptions options = Blocks::free_block();
    options.free = is_free;
    options.youngs_modulus = youngs_modulus;
    return options;
  }
  const Blocks& blocks(int body) const { return body == 0 ? clamped : free; }
  const Attachment& joint(int body) const { return world->state(body).attachments.front(); }

  Blocks clamped, free;
  std::unique_ptr<World> world;
};

// Each link bears what its own change of momentum and what hangs below leave of the weight, in every step, and once all
// hang still the weight below it.
TEST(AttachedBodies, OfAHangingChainBearWhatIsBelowThem) {
  constexpr int kLinks = 4;
  constexpr double kTimeStep = 0.1;  // by which backward Euler damps the swing of the chain
  const Eigen::Vector3d gravity(9.81, 0, 0);
  Chain chain(kTimeStep, kLinks, gravity, AttachmentKind::kFixed, 1e6, 0.02);
  const double weight = chain.free.mass() * gravity.norm();
  for (int i = 0; i < 1000; ++i) {
    std::vector<Eigen::Vector3d> before;
    for (int body = 1; body <= kLinks; ++body) before.push_back(free_state(chain.world->state(body)).linear_momentum);
    chain.world->step(1);
    for (int body = 1; body <= kLinks; ++body) {
      ASSERT_EQ(chain.world->report(body).status, 0U) << i;
      const Eigen::Vector3d rate =
          (free_state(chain.world->state(body)).linear_momentum - before[body - 1]) / kTimeStep;
      const Eigen::Vector3d below =
          body < kLinks ? chain.joint(body + 1).force : Eigen::Vector3d(Eigen::Vector3d::Zero());
      EXPECT_LE((rate - chain.free.mass() * gravity + chain.joint(body).force - below).norm(), 1e-9 * weight) << i;
    }
  }
  for (int body = 1; body <= kLinks; ++body) {
    EXPECT_NEAR(chain.joint(body).force[0], (kLinks + 1 - body) * weight, 1e-9 * kLinks * weight) << body;
  }
}

const Select kEndCentre = [](const Eigen::Vector3d& x) {
  return (x - Eigen::Vector3d(kLength, 0.1, 0.1)).norm() < 1e-9;
};
const Select kStartCentre = [](const Eigen::Vector3d& x) { return (x - Eigen::Vector3d(0, 0.1, 0.1)).norm() < 1e-9; };

/// Angles of two rigid bars of 0.4 x 0.2 m, hinged one on the other in the middle of their ends, after `time` from rest
/// along x, by Runge and Kutta's method.
Eigen::Vector2d double_pendulum(double mass, double gravity, double time) {
  const double L = kLength, r = L / 2, inertia = mass * (L * L + L * L / 4) / 12;
  const auto rate = [&](const Eigen::Vector4d& x) -> Eigen::Vector4d {
    const double apart = x[0] - x[1], both = mass * L * r * std::cos(apart), turn = mass * L * r * std::sin(apart);
    Eigen::Matrix2d M;
    M << inertia + mass * (r * r + L * L), both, both, inertia + mass * r * r;
    const Eigen::Vector2d forces(-turn * x[3] * x[3] - mass * gravity * (r + L) * std::cos(x[0]),
                                 turn * x[2] * x[2] - mass * gravity * r * std::cos(x[1]));
    const Eigen::Vector2d acceleration = M.inverse() * forces;
    return {x[2], x[3], acceleration[0], acceleration[1]};
  };
  constexpr int kSteps = 10000;
  const double h = time / kSteps;
  Eigen::Vector4d x = Eigen::Vector4d::Zero();
  for (int i = 0; i < kSteps; ++i) {
    const Eigen::Vector4d a = rate(x), b = rate(x + 0.5 * h * a), c = rate(x + 0.5 * h * b), d = rate(x + h * c);
    x += h / 6 * (a + 2 * b + 2 * c + d);
  }
  return x.head<2>();
}

// Stiff blocks that hang on balls by the middle of their ends swing as rigid ones. Islands are of first order: at half
// the step half the error, and what the two steps say together is right to 1e-3 of the length.
TEST(AttachedBodies, OfBallsSwingAsADoublePendulum) {
  constexpr double kTime = 0.5;
  const Eigen::Vector3d gravity(0, -9.81, 0);
  const auto centre_after = [&](int steps) -> Eigen::Vector3d {
    Chain chain(kTime / steps, 2, gravity, AttachmentKind::kBall, 1e11);
    for (int body = 1; body <= 2; ++body) {
      chain.world->state(body).attachments.clear();
      attach(*chain.world, {chain.free, body, kStartCentre}, {chain.blocks(body - 1), body - 1, kEndCentre},
             AttachmentKind::kBall);
    }
    for (int i = 0; i < steps; ++i) {
      chain.world->step(1);
      EXPECT_EQ(chain.world->report(1).status, 0U) << i;
    }
    return chain.free.centre(chain.world->state(2));
  };
  const Eigen::Vector3d coarse = centre_after(1000), fine = centre_after(2000);
  const Chain chain(1, 1, gravity, AttachmentKind::kBall);
  const Eigen::Vector2d angles = double_pendulum(chain.free.mass(), gravity.norm(), kTime);
  const auto along = [](double angle, double length) {
    return Eigen::Vector3d(length * std::cos(angle), length * std::sin(angle), 0);
  };
  const Eigen::Vector3d exact =
      Eigen::Vector3d(kLength, 0.1, 0.1) + along(angles[0], kLength) + along(angles[1], kLength / 2);
  EXPECT_GE((exact - Eigen::Vector3d(2.5 * kLength, 0.1, 0.1)).norm(), kLength) << "they have swung";
  EXPECT_NEAR((fine - exact).norm() / (coarse - exact).norm(), 0.5, 0.02);
  EXPECT_LE((2 * fine - coarse - exact).norm(), 1e-3 * kLength);
}

// The lowest of three breaks off by its own weight and falls; the others go on to hang.
TEST(AttachedBodies, PartWhereOneBearsTooMuch) {
  const Eigen::Vector3d gravity(9.81, 0, 0);
  Chain chain(0.01, 3, gravity, AttachmentKind::kFixed, 1e6, 0.02);
  chain.free.scene.meeting.mask = 0;
  chain.world->state(3).attachments[0].break_force = 0.5 * chain.free.mass() * gravity.norm();
  int step = 0;
  while (!chain.joint(3).broken && ++step < 100) chain.world->step(1);
  ASSERT_TRUE(chain.joint(3).broken);
  EXPECT_GT(chain.joint(3).force.norm(), 0.5 * chain.free.mass() * gravity.norm());
  const Eigen::Vector3d before = free_state(chain.world->state(3)).linear_momentum;
  chain.world->step(1);
  const Eigen::Vector3d rate = (free_state(chain.world->state(3)).linear_momentum - before) / 0.01;
  EXPECT_LE((rate - chain.free.mass() * gravity).norm(), 1e-9 * chain.free.mass() * gravity.norm());
  EXPECT_TRUE(chain.joint(3).force.isZero(0));
  EXPECT_FALSE(chain.joint(2).broken);
}

// Bodies that overlap where they are attached are let go without a push: a hundredth of a millimetre a second.
TEST(AttachedBodies, AreLetGoAtRest) {
  const Blocks blocks(0.002);
  World world({blocks.body(Eigen::Vector3d(0, 0, 0)), blocks.body(Eigen::Vector3d(kLength - 0.05, 0, 0))},
              {.stiffness = 1e6});
  attach(world, {blocks, 1, kStart}, {blocks, 0, kEnd}, AttachmentKind::kFixed);
  for (int i = 0; i < 10; ++i) world.step(1);
  world.state(1).attachments.clear();
  for (int i = 0; i < 100; ++i) world.step(1);
  EXPECT_LE(free_state(world.state(1)).linear_momentum.norm(), 1e-5 * blocks.mass());
}

TEST(AttachedBodies, SleepAndWakeTogether) {
  Blocks blocks(2e-3);
  blocks.set_gravity(9.81);
  blocks.add_floor(1e7, 0.5, 1e5);
  blocks.scene.mass_damping = 4;
  blocks.scene.stiffness_damping = 4e-3;
  blocks.scene.sleep = {1e-5, 0.1};
  World world({blocks.body(Eigen::Vector3d(0, 0, 0.001)), blocks.body(Eigen::Vector3d(kLength, 0, 0.001))},
              {.stiffness = 1e6});
  attach(world, {blocks, 1, kStart}, {blocks, 0, kEnd}, AttachmentKind::kFixed);
  int asleep = 0;
  for (int i = 0; i < 4000 && asleep == 0; ++i) asleep = world.step(1).asleep;
  ASSERT_EQ(asleep, 2);
  const Eigen::Vector3d load = world.state(1).attachments[0].force;
  EXPECT_EQ(world.step(1).asleep, 2);
  EXPECT_EQ(world.state(1).attachments[0].force, load) << "what they exert on each other stays";
  world.state(0).applied_force[0] += 1e-3;
  const WorldReport report = world.step(1);
  EXPECT_EQ(report.asleep, 0);
  EXPECT_EQ(report.largest_island, 2);
}

TEST(AttachedBodies, StepAlikeOnAnyNumberOfThreads) {
  std::array<Chain, 2> chains{Chain(0.01, 36, {0, -9.81, 0}, AttachmentKind::kBall),
                              Chain(0.01, 36, {0, -9.81, 0}, AttachmentKind::kBall)};
  for (int i = 0; i < 10; ++i) {
    EXPECT_EQ(chains[0].world->step(1).largest_island, 37);
    chains[1].world->step(2);
    EXPECT_EQ(chains[0].world->report(36).status, 0U);
  }
  for (int body = 0; body <= 36; ++body) {
    EXPECT_EQ(chains[0].world->state(body).q, chains[1].world->state(body).q) << body;
    if (body > 0) EXPECT_EQ(chains[0].joint(body).force, chains[1].joint(body).force) << body;
  }
}

// A triangle of bodies, each fixed to the next, has six conditions too many, and two bodies that are attached twice as
// well.
TEST(AttachedBodies, MayBeHeldMoreThanOnce) {
  const Blocks blocks(0.002);
  World world({blocks.body(Eigen::Vector3d(0, 0, 0), {0.3, 1, -0.2}), blocks.body(Eigen::Vector3d(kLength, 0, 0)),
               blocks.body(Eigen::Vector3d(0, 0.3, 0), {0, 0, 0}, {1, 2, 3})},
              {.stiffness = 1e6});
  const std::array<std::pair<int, int>, 4> pairs{{{1, 0}, {2, 1}, {2, 0}, {1, 0}}};
  std::vector<Open> open;
  for (const auto& [own, other] : pairs) {
    attach(world, {blocks, own, kStart}, {blocks, other, kEnd}, AttachmentKind::kFixed);
    open.emplace_back(world, Side{blocks, own, kStart}, Side{blocks, other, kEnd});
  }
  const test::Momenta start = test::momenta(blocks, world);
  for (int i = 0; i < 100; ++i) {
    world.step(1);
    ASSERT_EQ(world.report(0).status, 0U) << i;
  }
  for (const Open& own : open) {
    EXPECT_LE(own.mean(world), 1e-10 * kLength);
    EXPECT_LE(own.turn(world), 1e-10);
  }
  const test::Momenta end = test::momenta(blocks, world);
  EXPECT_LE((end.linear - start.linear).norm(), 1e-12 * start.linear.norm());
  EXPECT_LE((end.angular - start.angular).norm(), 1e-12 * start.angular.norm());
}

/// A clamped bar of 2 x 0.4 x 0.4 m, without weight, and a free one of `ratio` times its mass at its end.
struct Hung {
  Hung(double time_step, MaterialModel material, double youngs_modulus, double ratio, double gravity)
      : bar(time_step, options(material, youngs_modulus, 1, false)),
        heavy(time_step, options(material, youngs_modulus * ratio, ratio, true)) {
    heavy.scene.gravity = Eigen::Vector3d(0, 0, -gravity);
    world.emplace(
        std::vector<WorldBodyStart>{WorldBodyStart{{bar.model.get(), &bar.scene, bar.surface}, make_state(*bar.model)},
                                    heavy.body(Eigen::Vector3d(kReach, 0, 0))},
        ContactLaw{.stiffness = 1e6});
    prepare_contacts(*bar.model, 0, world->state(0));
    attach(*world, {heavy, 1, kStart}, {bar, 0, kFarEnd}, AttachmentKind::kBall);
  }

  static exmat::test::BarOptions options(MaterialModel material, double youngs_modulus, double density, bool free) {
    return {.cells = {10, 2, 2},
            .lengths = {kReach, kWidth, kWidth},
            .youngs_modulus = youngs_modulus,
            .material = material,
            .density = 1000 * density,
            .free = free};
  }

  static constexpr double kReach = 2, kWidth = 0.4;
  static inline const Select kFarEnd = [](const Eigen::Vector3d& x) { return x[0] > kReach - 1e-9; };
  Blocks bar, heavy;
  std::optional<World> world;
};

// A soft bar holds far heavier ones, whatever that makes of its end, which the load squeezes to a line: some steps have
// no solution in one.
TEST(AttachedBodies, HoldAThousandTimesTheirMass) {
  int divided = 0;
  for (const MaterialModel material : {MaterialModel::kStVenantKirchhoff, MaterialModel::kStableNeoHookean})
    for (const double ratio : {10.0, 1000.0})
      for (const double rate : {60.0, 240.0}) {
        Hung hung(1 / rate, material, 1e5, ratio, 9.81);
        double energy = hung.world->energies().total();
        const double scale = hung.heavy.mass() * 9.81 * Hung::kReach;
        for (int i = 0; i < 4 * rate; ++i) {
          divided += hung.world->step(1).divided_islands;
          ASSERT_EQ(hung.world->report(0).status & ~kStepDivided, 0U)
              << ratio << ", " << rate << ": " << i / rate << " s";
          const double now = hung.world->energies().total();
          ASSERT_LE(now, energy + 1e-6 * scale) << ratio << ", " << rate << ": " << i / rate << " s";
          energy = now;
        }
      }
  EXPECT_GT(divided, 0);
}

// Soft bodies meet the ground so fast that the patches between them are pressed flat, and inside out: no rotation is
// theirs there. Steps stay finite and gain no energy, and in the end the bodies are together as they were.
TEST(AttachedBodies, ComeTogetherAgainAfterTheGroundPressedThemFlat) {
  for (const double youngs_modulus : {1e3, 1e4})
    for (const double rate : {60.0, 240.0})
      for (const double tilt : {-0.9, -0.3, 0.4}) {
        exmat::test::BarOptions options = Blocks::free_block();
        options.youngs_modulus = youngs_modulus;
        options.material = MaterialModel::kStableNeoHookean;
        Blocks blocks(1 / rate, options);
        blocks.scene.mass_damping = 2;
        blocks.set_gravity(9.81);
        blocks.add_floor(1e6, 0.3, 0);
        const Eigen::Quaterniond turn(Eigen::AngleAxisd(tilt, Eigen::Vector3d::UnitY()));
        const Eigen::Vector3d at(0, 0, 0.6), down(0, 0, -10), none(0, 0, 0),
            next = turn * Eigen::Vector3d(kLength, 0, 0);
        World world({blocks.body(at, down, none, turn), blocks.body(at + next, down, none, turn)}, {.stiffness = 1e6});
        const Side own{blocks, 1, kStart}, other{blocks, 0, kEnd};
        attach(world, own, other, AttachmentKind::kFixed);
        const Open open(world, own, other);
        const double start = world.energies().total(), scale = world.energies().kinetic;
        const auto run = ::testing::Message() << youngs_modulus << " Pa, " << rate << " Hz, " << tilt;
        for (int i = 0; i < 3 * rate; ++i) {
          world.step(1);
          ASSERT_EQ(world.report(0).status & kStepNonFinite, 0U) << run << ": " << i;
          ASSERT_LE(world.energies().total(), start + 1e-6 * scale) << run << ": " << i;
        }
        EXPECT_LE(open.mean(world), 1e-10 * kLength) << run;
        EXPECT_LE(open.turn(world), 1e-10) << run;
      }
}

TEST(AttachedBodies, AreLetGoWithTheOneThatIsTakenOut) {
  const Blocks blocks(0.002);
  World world({blocks.body(Eigen::Vector3d(0, 0, 0)), blocks.body(Eigen::Vector3d(kLength, 0, 0)),
               blocks.body(Eigen::Vector3d(2 * kLength, 0, 0))},
              {.stiffness = 1e6});
  attach(world, {blocks, 1, kStart}, {blocks, 0, kEnd}, AttachmentKind::kFixed);
  attach(world, {blocks, 2, kStart}, {blocks, 1, kEnd}, AttachmentKind::kFixed);
  EXPECT_EQ(world.step(1).largest_island, 3);
  world.remove(0);
  EXPECT_TRUE(world.state(0).attachments.empty());
  EXPECT_EQ(world.step(1).largest_island, 2);
  EXPECT_TRUE(world.is_attached(0));
  world.remove(1);
  EXPECT_FALSE(world.is_attached(0));
  EXPECT_EQ(world.step(1).largest_island, 0);
}

}  // namespace attached_bodies_test
}  // namespace exmat::runtime
