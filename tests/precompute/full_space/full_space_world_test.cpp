#include "precompute/full_space/full_space_world.h"

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "precompute/full_space/world_potential.h"
#include "tests/precompute/full_space/full_space_bar.h"
#include "tests/runtime/sim/world/touching_blocks.h"
#include "tests/support/full_collision.h"
#include "tests/support/random.h"

namespace exmat::precompute {
namespace {

using runtime::ContactLaw;
using runtime::FrameMotion;
using runtime::test::Blocks;
using test::FullCollision;

/// Bar of few vertices, all of which are on the surface.
test::BarOptions bar_options(int linear_modes = 12) {
  test::BarOptions options = Blocks::free_block();
  options.cells = {3, 1, 1};
  options.youngs_modulus = 2e5;
  options.linear_modes = linear_modes;
  return options;
}

struct FullBar {
  explicit FullBar(const test::BarOptions& options = bar_options()) : bar(test::make_bar(options)) {
    bar.model.contact = test::surface_contact(bar.model);
    model = build_full_space_model(bar.model);
  }

  FullSpaceState start(const FrameMotion& motion) const {
    return make_full_space_state(model, Eigen::VectorXd::Zero(model.rest.size()), motion);
  }
  FullSpaceWorld world(const FullSpaceScene& scene, const ContactLaw& law,
                       const std::vector<FrameMotion>& motions) const {
    FullSpaceWorld world(law);
    for (const FrameMotion& motion : motions) world.add(bar.model, model, scene, start(motion));
    return world;
  }

  test::Bar bar;
  FullSpaceModel model;
};

FullSpaceScene scene_of(double time_step) {
  FullSpaceScene scene;
  scene.time_step = time_step;
  scene.newton = {200, 1e-8};
  return scene;
}

/// Positions of all vertices of all bodies.
Eigen::VectorXd positions(const FullSpaceWorld& world) {
  const Eigen::Index size = world.body(0).model->rest.size();
  Eigen::VectorXd all(static_cast<Eigen::Index>(world.count()) * size);
  for (std::size_t i = 0; i < world.count(); ++i)
    all.segment(static_cast<Eigen::Index>(i) * size, size) =
        world_positions(*world.body(i).model, world.body(i).state).reshaped<Eigen::RowMajor>();
  return all;
}

/// Linear momentum, and angular about the origin.
std::pair<Eigen::Vector3d, Eigen::Vector3d> momenta(const FullSpaceWorld& world) {
  Eigen::Vector3d linear = Eigen::Vector3d::Zero(), angular = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i < world.count(); ++i) {
    const FullSpaceBody& body = world.body(i);
    const Eigen::VectorXd momentum = body.model->system.mass * body.state.v;
    const VertexArray x = world_positions(*body.model, body.state);
    for (Eigen::Index k = 0; k < x.rows(); ++k) {
      linear += momentum.segment<3>(3 * k);
      angular += x.row(k).transpose().cross(momentum.segment<3>(3 * k));
    }
  }
  return {linear, angular};
}

void run(FullSpaceWorld& world, int steps, int* contacts = nullptr) {
  for (int i = 0; i < steps; ++i) {
    const FullSpaceWorldReport report = world.step();
    ASSERT_FALSE(report.non_finite) << i;
    // Without contacts, forces are those of rounding, which no solution is above.
    if (report.contacts > 0) {
      ASSERT_EQ(report.newton.status, runtime::NewtonStatus::kConverged) << i;
    }
    if (contacts != nullptr) *contacts += report.contacts;
  }
}

const std::vector<FrameMotion> kHeadOn{{{0, 0, 0}, Eigen::Quaterniond::Identity(), {1, 0, 0}, {0, 0, 0}},
                                       {{0.42, 0.033, 0.027}, Eigen::Quaterniond::Identity(), {-1, 0, 0}, {0, 0, 0}}};
const std::vector<FrameMotion> kOblique{
    {{0, 0, 0}, Eigen::Quaterniond::Identity(), {1, 0.2, 0}, {0, 0, 2}},
    {{0.43, 0.06, 0.04},
     Eigen::Quaterniond(Eigen::AngleAxisd(0.5, Eigen::Vector3d(1, 2, 3).normalized())),
     {-1, 0, 0.1},
     {1, 0, 0}}};

class FullSpaceCollision : public ::testing::TestWithParam<std::vector<FrameMotion>> {};

TEST_P(FullSpaceCollision, IsThatOfRungeAndKuttaToTheOrderOfTheStep) {
  constexpr double kStiffness = 3e6, kTime = 0.06;  // the bars meet after 0.01 s and part after 0.04 s
  const FullBar bar;
  const FullCollision full(bar.bar, kStiffness);
  std::array<FullCollision::Motion, 2> starts;
  for (std::size_t k = 0; k < 2; ++k) {
    const FullSpaceState state = bar.start(GetParam()[k]);
    starts[k] = {world_positions(bar.model, state).reshaped<Eigen::RowMajor>(),
                 world_velocities(bar.model, state).reshaped<Eigen::RowMajor>()};
  }
  const auto end = full.run(starts, kTime, 6000);
  Eigen::VectorXd expected(2 * end[0].x.size()), flown(expected.size());
  expected << end[0].x, end[1].x;
  flown << starts[0].x + kTime * starts[0].v, starts[1].x + kTime * starts[1].v;
  const auto collide = [&](double time_step) {
    const FullSpaceScene scene = scene_of(time_step);
    // A corner of the oblique one begins in the other, and the reference lets nothing out slowly.
    FullSpaceWorld world = bar.world(scene, {.stiffness = kStiffness, .release = 1e9}, GetParam());
    int contacts = 0;
    run(world, static_cast<int>(std::lround(kTime / time_step)), &contacts);
    EXPECT_GT(contacts, 0);
    return positions(world);
  };
  const double made = (expected - flown).norm();
  const auto error = [&](const Eigen::VectorXd& found) { return (found - expected).norm() / made; };
  const Eigen::VectorXd coarse = collide(1e-4), fine = collide(5e-5);
  RecordProperty("error", std::to_string(error(coarse)));
  // Backward Euler is of first order, with a contact that begins and ends in between.
  EXPECT_LE(error(coarse), 0.013);
  EXPECT_LE(error(fine), 0.65 * error(coarse));
  EXPECT_LE(error(2 * fine - coarse), 0.006);
}

INSTANTIATE_TEST_SUITE_P(Starts, FullSpaceCollision, ::testing::Values(kHeadOn, kOblique));

/// A pair of bodies near each other, ready to be minimised.
struct Prepared {
  explicit Prepared(const ContactLaw& law) : bars{bar.start(kOblique[0]), bar.start(kOblique[1])} {
    scene.gravity = {0, 0, -9.81};
    scene.stiffness_damping = 0.001;
    bars[1].q.reshaped(3, bars[1].q.size() / 3).colwise() -= Eigen::Vector3d(0.12, 0, 0);  // into the other
    for (std::size_t k = 0; k < 2; ++k) {
      workspaces.push_back(std::make_unique<FullSpaceWorkspace>(bar.model));
      surfaces[k].emplace(bar.bar.model, bar.model, bars[k]);
    }
    for (std::size_t k = 0; k < 2; ++k) {
      steps.push_back(std::make_unique<FullSpaceStep>(bar.model, scene, bars[k], *workspaces[k]));
      EXPECT_TRUE(steps.back()->begin(true));
      stepped.push_back({&bar.model, &bars[k], steps.back().get()});
      contacts.push_back({k, 1 - k,
                          std::make_unique<SurfaceContacts>(law, *surfaces[k], *surfaces[1 - k], scene.time_step, 0.05,
                                                            true, HeldVertices())});
    }
  }

  FullBar bar;
  FullSpaceScene scene = scene_of(0.002);
  std::array<FullSpaceState, 2> bars;
  std::vector<std::unique_ptr<FullSpaceWorkspace>> workspaces;
  std::array<std::optional<MovingSurface>, 2> surfaces;
  std::vector<std::unique_ptr<FullSpaceStep>> steps;
  std::vector<SteppedBody> stepped;
  std::vector<DirectedContacts> contacts;
};

TEST(WorldPotential, GradientAndHessianAreItsDerivatives) {
  Prepared two({3e6, 1e3, 0.4});
  WorldPotential potential(two.stepped, two.contacts);
  Eigen::VectorXd d = potential.start(), gradient;
  potential.evaluate_first(d, gradient);
  potential.refresh_friction();  // so that there is some
  const Eigen::VectorXd along = test::random_vector(d.size(), 3);
  int touching = 0;
  for (const DirectedContacts& directed : two.contacts) touching += directed.contacts->touching();
  ASSERT_GE(touching, 3);

  const double h = 1e-7;
  const auto value = [&](double s) { return potential.value(d + s * h * along).value; };
  potential.evaluate(d, gradient);
  // Central differences of fourth order.
  const double slope = (8 * (value(1) - value(-1)) - (value(2) - value(-2))) / (12 * h);
  EXPECT_NEAR(slope, gradient.dot(along), 1e-5 * gradient.norm() * along.norm());

  Eigen::VectorXd before, after;
  potential.evaluate(d - h * along, before);
  potential.evaluate(d + h * along, after);
  potential.evaluate(d, gradient);
  potential.assemble(d, runtime::Tangent::kExact);
  const Eigen::VectorXd expected = (after - before) / (2 * h);
  // The stiffness of friction leaves nothing out; that of the law's corner where damping ends is not met here.
  EXPECT_LE((potential.product(along) - expected).norm(), 1e-4 * expected.norm());
  // Block by block, the sparse part is the product without what couples the bodies.
  const Eigen::Index half = d.size() / 2;
  Eigen::VectorXd one = along;
  one.tail(half).setZero();
  const Eigen::VectorXd sparse = potential.hessian().selfadjointView<Eigen::Lower>() * one;
  EXPECT_LE((sparse - potential.product(one)).head(half).norm(), 1e-12 * sparse.norm());
  EXPECT_GT(potential.product(one).tail(half).norm(), 1e-3 * sparse.norm());
}

/// Two blocks fall onto a floor, one onto the other, and slide: friction, damping, gravity, an obstacle. How far the
/// two worlds are from each other, over how far the bodies went.
double distance_of_worlds(double time_step) {
  const ContactLaw law{1e6, 2e3, 0.4};
  const std::vector<FrameMotion> motions{{{0, 0, 0.001}, Eigen::Quaterniond::Identity(), {0.5, 0, 0}, {0, 0, 0}},
                                         {{0.05, 0.02, 0.203}, Eigen::Quaterniond::Identity(), {0, 0, -1}, {0, 0, 0}}};
  const int steps = static_cast<int>(std::lround(0.2 / time_step));
  const auto all = bar_options(all_modes(bar_options()));
  Blocks blocks(time_step, all);
  blocks.add_floor(1e6, 0.3, 2e3);
  blocks.set_gravity(9.81);
  runtime::World reduced({blocks.body(motions[0]), blocks.body(motions[1])}, law);
  for (int i = 0; i < steps; ++i) EXPECT_EQ(reduced.step(1).unconverged_islands, 0);
  const FullBar bar(all);
  FullSpaceScene scene = scene_of(time_step);
  scene.gravity = blocks.scene.gravity;
  scene.obstacles = blocks.scene.obstacles;
  FullSpaceWorld world = bar.world(scene, law, motions);
  const Eigen::VectorXd start = positions(world);
  int contacts = 0;
  run(world, steps, &contacts);
  EXPECT_GT(contacts, 2 * steps);
  Eigen::VectorXd expected(start.size());
  for (int k = 0; k < 2; ++k) {
    const runtime::Placement placement = blocks.model->frame->placement(reduced.state(k).frame);
    const Eigen::VectorXd moved =
        blocks.bar.model.object->mesh.vertices.reshaped<Eigen::RowMajor>() + blocks.bar.basis() * reduced.state(k).q;
    for (Eigen::Index i = 0; i < moved.size(); i += 3)
      expected.segment<3>(k * moved.size() + i) = placement.to_world(moved.segment<3>(i));
  }
  return (positions(world) - expected).norm() / (expected - start).norm();
}

TEST(FullSpaceWorld, IsTheWorldOfTheRunTimeWithAllModes) {
  // They differ by the order of the step: in how inertia and friction turn with a moving frame.
  const double coarse = distance_of_worlds(1e-3), fine = distance_of_worlds(5e-4);
  RecordProperty("coarse", std::to_string(coarse));
  RecordProperty("fine", std::to_string(fine));
  EXPECT_LE(coarse, 0.03);
  EXPECT_LE(fine, 0.65 * coarse);
}

TEST(FullSpaceWorld, MomentaArePassedOn) {
  const FullBar bar;
  const FullSpaceScene scene = scene_of(5e-4);
  FullSpaceWorld world = bar.world(scene, {3e6, 1e3, 0.3}, kOblique);
  const auto [linear, angular] = momenta(world);
  int contacts = 0;
  run(world, 120, &contacts);
  ASSERT_GT(contacts, 20);
  const auto [linear_end, angular_end] = momenta(world);
  const double scale = test::make_bar(bar_options()).model.rigid->mass;  // at 1 m/s
  EXPECT_LE((linear_end - linear).norm(), 1e-8 * scale);
  // Backward Euler damps rotation, and friction acts at the gap: to the order of the step.
  EXPECT_LE((angular_end - angular).norm(), 0.02 * angular.norm());
}

TEST(FullSpaceWorld, BodiesThatNothingIsNearAreStepedAlone) {
  const FullBar bar;
  FullSpaceScene scene = scene_of(0.002);
  scene.gravity = {0, 0, -1};
  FullSpaceWorld world =
      bar.world(scene, {3e6, 0, 0}, {kOblique[0], {{5, 0, 0}, kOblique[1].orientation, {0, 1, 0}, {}}});
  FullSpaceState alone = bar.start(kOblique[0]);
  FullSpaceWorkspace workspace(bar.model);
  for (int i = 0; i < 20; ++i) {
    EXPECT_EQ(world.step().touching_bodies, 0);
    step(bar.model, scene, alone, workspace);
  }
  EXPECT_EQ(world.body(0).state.q, alone.q);
}

}  // namespace
}  // namespace exmat::precompute
