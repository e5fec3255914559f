#include "precompute/full_space/full_space_stepper.h"

#include <cmath>
#include <gtest/gtest.h>
#include <utility>

#include "common/core/error.h"
#include "precompute/mesh_io/mesh_file.h"
#include "runtime/sim/space/full/full_potential.h"
#include "tests/precompute/full_space/full_space_bar.h"
#include "tests/support/random.h"
#include "tests/support/sparse_space/step_potential.h"

namespace exmat::precompute {
namespace {

/// The bar of examples/01_twisted_bar: 340 vertices, 1,042 tets, 4 m long.
SparseModel bar_of_the_examples(MaterialModel model, Formulation formulation) {
  ReducedModel reduced;
  ObjectData& object = reduced.object.emplace();
  object.mesh = read_mesh(EXMAT_SOURCE_DIR "/examples/01_twisted_bar/bar.msh").mesh;
  const Eigen::Index tets = object.mesh.tet_count();
  object.materials.density = Eigen::VectorXd::Constant(tets, 1000);
  object.materials.youngs_modulus = Eigen::VectorXd::Constant(tets, 1e6);
  object.materials.poisson_ratio = Eigen::VectorXd::Constant(tets, 0.4);
  object.materials.model = model;
  object.materials.formulation = formulation;
  object.materials.variance_factor = formulation == Formulation::kSmoothed ? kVarianceFactor : 0;
  object.fixed = FlagVector::Zero(object.mesh.vertex_count());
  for (Eigen::Index v = 0; v < object.fixed.size(); ++v) object.fixed[v] = object.mesh.vertices(v, 0) < 0.01;
  return build_sparse_model(reduced);
}

/// Pushed at the end from 0.04 to 0.2 s, under gravity, damped.
FullSpaceScene pushed(const SparseModel& model, double tolerance) {
  FullSpaceScene scene;
  scene.time_step = 0.004;
  scene.gravity = {0, 0, -1};
  scene.mass_damping = 0.2;
  scene.stiffness_damping = 0.01;
  scene.newton = {50, tolerance};
  VertexForceConfig& force = scene.forces.emplace_back();
  for (Eigen::Index v = 0; v < model.rest.rows(); ++v)
    if (model.rest(v, 0) > model.rest.col(0).maxCoeff() - 1e-3) force.vertices.push_back(v);
  force.force = Eigen::Vector3d(0, 60, 40);
  force.start = 0.04;
  force.end = 0.2;
  return scene;
}

struct Compared {
  double largest = 0, error = 0;  ///< largest norms of q expected and of the difference
  void add(const Eigen::VectorXd& q, const Eigen::VectorXd& expected) {
    largest = std::max(largest, expected.norm());
    error = std::max(error, (q - expected).norm());
  }
};

/// A hundred steps from rest of both, each of which has to be sound.
struct Twins {
  FullSpaceState expected, state;
  Compared compared;
  Twins(const SparseModel& model, const FullSpaceScene& scene, FullSpaceStepper& stepper)
      : expected(at_rest(model)), state(expected) {
    SparseWorkspace workspace(model);
    for (int i = 0; i < 100; ++i) {
      EXPECT_EQ(step(model, scene, expected, workspace).status, 0U) << i;
      EXPECT_EQ(stepper.step(state).status, 0U) << i;
      EXPECT_NEAR(state.elastic_energy, expected.elastic_energy, 1e-6 * expected.elastic_energy) << i;
      compared.add(state.q, expected.q);
    }
  }
};

// Both meet a residual of 1e-9 of the forces; the error of a displacement is that times how much softer the body is
// than its stiffest part.
TEST(FullSpaceStepperTest, IsTheReferenceOnTheBarOfTheExamples) {
  for (const MaterialModel material :
       {MaterialModel::kStVenantKirchhoff, MaterialModel::kStableNeoHookean, MaterialModel::kCorotational})
    for (const Formulation formulation : {Formulation::kSmoothed, Formulation::kLinear}) {
      if (formulation == Formulation::kLinear && material != MaterialModel::kStVenantKirchhoff) continue;
      const SparseModel model = bar_of_the_examples(material, formulation);
      const FullSpaceScene scene = pushed(model, 1e-9);
      FullSpaceStepper stepper(model);
      stepper.set(scene);
      const auto [expected, state, compared] = Twins(model, scene, stepper);
      EXPECT_GE(compared.largest, 0.9);
      EXPECT_LE(compared.error, 1e-6 * compared.largest);
      EXPECT_LE((state.v - expected.v).norm(), 1e-5 * expected.v.norm());
    }
}

TEST(FullSpaceStepperTest, FewIterationsAreWithinHalfAPercentOfTheReference) {
  const SparseModel model = bar_of_the_examples(MaterialModel::kStVenantKirchhoff, Formulation::kSmoothed);
  const FullSpaceScene scene = pushed(model, 1e-8);
  runtime::StepScene quick;
  quick.time_step = scene.time_step;
  quick.gravity = scene.gravity;
  quick.mass_damping = scene.mass_damping;
  quick.stiffness_damping = scene.stiffness_damping;
  Eigen::VectorXd force = Eigen::VectorXd::Zero(3 * model.rest.rows());
  for (const std::int64_t vertex : scene.forces.front().vertices)
    force.segment<3>(3 * vertex) = scene.forces.front().force;
  quick.forces.push_back({.start = 0.04, .end = 0.2, .on_vertices = model.system.restrict(force)});
  runtime::FullWorkspace quick_workspace(model.matrix_free, quick, runtime::kRealTime);
  SparseWorkspace workspace(model);
  FullSpaceState expected = at_rest(model), state = expected;
  Compared compared;
  int iterations = 0;
  for (int i = 0; i < 100; ++i) {
    ASSERT_EQ(step(model, scene, expected, workspace).status, 0U);
    const runtime::FullReport report = runtime::step(model.matrix_free, quick, state, quick_workspace);
    ASSERT_EQ(report.status, 0U);
    iterations += report.cg_iterations;
    compared.add(state.q, expected.q);
  }
  EXPECT_GE(compared.largest, 0.9);
  EXPECT_LE(compared.error, 0.005 * compared.largest);
  EXPECT_LE(iterations, 4 * 100);
}

FullSpaceScene pulled_by_examples(runtime::ExampleSettings settings) {
  FullSpaceScene scene;
  scene.time_step = 0.002;
  scene.gravity = {0, 1, -1};
  scene.stiffness_damping = 0.005;
  scene.newton = {50, 1e-9};
  scene.examples.push_back(std::move(settings));
  return scene;
}

TEST(FullSpaceStepperTest, IsTheReferenceUnderAnElasticExampleForce) {
  for (const MaterialModel material :
       {MaterialModel::kStVenantKirchhoff, MaterialModel::kStableNeoHookean, MaterialModel::kCorotational}) {
    const test::BarOptions options{.material = material, .eigenfunctions = 8, .examples = 3};
    const test::Bar bar = complete_bar(options);
    const SparseModel model = build_sparse_model(bar.model, targets_of(options));
    const FullSpaceScene scene = pulled_by_examples({.stiffness = 2, .damping = 2, .bias = 0.4, .elastic = true});
    FullSpaceStepper stepper(model);
    stepper.set(scene);
    const auto [expected, state, compared] = Twins(model, scene, stepper);
    EXPECT_LE(compared.error, 1e-6 * compared.largest);
    EXPECT_LE((state.examples[0].weights - expected.examples[0].weights).norm(), 1e-6);
  }
}

TEST(FullSpaceStepperTest, IsTheReferenceUnderAnExampleForce) {
  const test::BarOptions options{.eigenfunctions = 8, .examples = 3};
  const test::Bar bar = complete_bar(options);
  const SparseModel model = build_sparse_model(bar.model, targets_of(options));
  FullSpaceScene scene = pulled_by_examples({.stiffness = 300, .damping = 2, .bias = 0.4});
  FullSpaceStepper stepper(model);
  stepper.set(scene);
  const auto [expected, state, compared] = Twins(model, scene, stepper);
  EXPECT_LE(compared.error, 1e-6 * compared.largest);
  EXPECT_LE((state.examples[0].weights - expected.examples[0].weights).norm(), 1e-6);
  EXPECT_LE((state.examples[0].target - expected.examples[0].target).norm(), 1e-6 * expected.examples[0].target.norm());

  // Without the force the body is elsewhere.
  FullSpaceState other = at_rest(model);
  scene.examples.clear();
  stepper.set(scene);
  for (int i = 0; i < 100; ++i) ASSERT_EQ(stepper.step(other).status, 0U);
  EXPECT_GE((other.q - expected.q).norm(), 0.05 * compared.largest);
}

// One that is seen from its band and one that stands on fixed vertices, pulled by springs and elastically, beside what
// pulls the whole body.
TEST(FullSpaceStepperTest, IsTheReferenceUnderForcesOfRegions) {
  const test::BarOptions options{.cells = {4, 1, 1}, .eigenfunctions = 8, .examples = 3};
  test::Bar bar = complete_bar(options);
  for (const bool outer : {true, false})
    add_region(bar.model, outer ? "outer" : "inner", part_of_bar(bar.model, outer));
  const SparseModel model = build_sparse_model(bar.model, {.whole_body = true, .regions = {{"outer"}, {"inner"}}});
  for (const bool elastic : {false, true}) {
    FullSpaceScene scene = pulled_by_examples({.stiffness = 300, .damping = 2, .bias = 0.4});
    for (const double bias : {0.2, 0.7})
      scene.examples.push_back({.stiffness = elastic ? 4.0 : 2000.0, .damping = 1, .bias = bias, .elastic = elastic});
    FullSpaceStepper stepper(model);
    stepper.set(scene);
    const auto [expected, state, compared] = Twins(model, scene, stepper);
    EXPECT_LE(compared.error, 1e-6 * compared.largest);
    for (std::size_t group = 0; group < 3; ++group)
      EXPECT_LE((state.examples[group].weights - expected.examples[group].weights).norm(), 1e-6) << group;
  }
}

/// Distance of a free bar that turns and is pulled by an example from the reference after 0.2 s, over the way of its
/// vertices and over its deformation.
struct FreeErrors {
  double position = 0, shape = 0;
};
FreeErrors errors_of_a_free_bar(const SparseModel& model, FullSpaceScene scene, double time_step) {
  scene.time_step = time_step;
  FullSpaceStepper stepper(model);
  stepper.set(scene);
  runtime::FrameMotion motion;
  motion.linear_velocity = {1, 0, 0};
  motion.angular_velocity = {2, 1, -3};
  const Eigen::VectorXd rest = Eigen::VectorXd::Zero(model.rest.size());
  FullSpaceState expected = make_full_space_state(model, rest, motion), state = expected;
  SparseWorkspace workspace(model);
  for (int i = 0; i < std::lround(0.2 / time_step); ++i) {
    EXPECT_EQ(step(model, scene, expected, workspace).status, 0U) << i;
    EXPECT_EQ(stepper.step(state).status, 0U) << i;
  }
  const Eigen::VectorXd shape = Deformation(model, expected.q).u();
  return {(state.q - expected.q).norm() / expected.q.norm(),
          (Deformation(model, state.q).u() - shape).norm() / shape.norm()};
}

// The reference loses angular momentum to its integrator, which is of second order, where the body here keeps it.
TEST(FullSpaceStepperTest, IsTheReferenceOfAFreeBodyToTheOrderOfTheStep) {
  const test::BarOptions options{.free = true, .eigenfunctions = 8, .examples = 3};
  const test::Bar bar = complete_bar(options);
  const SparseModel model = build_sparse_model(bar.model, targets_of(options));
  FullSpaceScene scene = pulled_by_examples({.stiffness = 300, .damping = 2, .bias = 0.4});
  scene.mass_damping = 0.5;
  const FreeErrors coarse = errors_of_a_free_bar(model, scene, 0.004), fine = errors_of_a_free_bar(model, scene, 0.002),
                   finest = errors_of_a_free_bar(model, scene, 0.001);
  EXPECT_LE(finest.position, 1e-5);
  // Damping takes off rigid motion by where the body is, in the reference by where it rests. A force with a torque
  // would leave 2.5e-3 at each time step.
  EXPECT_LE(finest.shape, 3e-4);
  EXPECT_GE(coarse.position / fine.position, 3.4);
  EXPECT_GE(fine.position / finest.position, 3.4);

  // An elastic force excites faster motions. Without damping the two differ by the order of the step alone.
  scene.examples = {{.stiffness = 0.1, .bias = 0.4, .elastic = true}};
  scene.mass_damping = scene.stiffness_damping = 0;
  const FreeErrors elastic_fine = errors_of_a_free_bar(model, scene, 0.001),
                   elastic_finest = errors_of_a_free_bar(model, scene, 0.0005);
  EXPECT_LE(elastic_finest.position, 5e-5);
  EXPECT_GE(elastic_fine.position / elastic_finest.position, 3.4);
  EXPECT_GE(elastic_fine.shape / elastic_finest.shape, 3.4);
}

// The body goes far in a step from where its damping was frozen.
TEST(FullSpaceStepperTest, AStrongPullOfADampedFreeBodyIsSolved) {
  const test::BarOptions options{.free = true, .eigenfunctions = 8, .examples = 3};
  const test::Bar bar = complete_bar(options);
  const SparseModel model = build_sparse_model(bar.model, targets_of(options));
  for (const auto& [stiffness, elastic] : {std::pair(1.0, true), std::pair(2.0, true), std::pair(3e4, false)}) {
    SCOPED_TRACE(stiffness);
    FullSpaceScene scene = pulled_by_examples({.stiffness = stiffness, .bias = 0.4, .elastic = elastic});
    scene.time_step = 0.004;
    scene.mass_damping = 0.5;
    FullSpaceStepper stepper(model);
    stepper.set(scene);
    FullSpaceState state = at_rest(model);
    for (int i = 0; i < 10; ++i) EXPECT_EQ(stepper.step(state).status, 0U) << i;
  }
}

// Backward Euler throughout, which both take near the floor.
TEST(FullSpaceStepperTest, IsTheReferenceOnAFloor) {
  test::Bar bar = complete_bar({.cells = {4, 1, 1}, .free = true});
  bar.model.contact = test::surface_contact(bar.model);
  const SparseModel model = build_sparse_model(bar.model);
  FullSpaceScene scene;
  scene.time_step = 0.001;
  scene.integrator = Integrator::kBackwardEuler;
  scene.gravity = {0.5, -9, 0.2};
  scene.newton = {50, 1e-9};
  scene.obstacles = {runtime::Obstacle{runtime::Plane{{0, -0.05, 0}, {0, 1, 0}}, {}, 1e6, 1e3, 0.4}};
  FullSpaceStepper stepper(model);
  stepper.set(scene);
  FullSpaceState expected = at_rest(model), state = expected;
  SparseWorkspace workspace(model);
  Compared compared;
  int contacts = 0;
  for (int i = 0; i < 250; ++i) {
    contacts += step(model, scene, expected, workspace).contacts;
    ASSERT_EQ(stepper.step(state).status, 0U) << i;
    compared.add(state.q, expected.q);
  }
  EXPECT_GE(contacts, 500);
  // Apart from its integrator, which loses angular momentum where this body keeps it.
  EXPECT_LE(compared.error, 2e-3 * compared.largest);
}

TEST(FullSpaceStepperTest, ElementsHaveTheEnergyOfTheReference) {
  for (const MaterialModel material : {MaterialModel::kStVenantKirchhoff, MaterialModel::kStableNeoHookean}) {
    const SparseModel model = bar_of_the_examples(material, Formulation::kSmoothed);
    const Eigen::VectorXd u = 0.02 * test::random_vector(model.size(), 4);
    const runtime::StepScene scene;
    const runtime::StepForm form{0, 0, u, u};
    runtime::FullPotentialWorkspace workspace(model.matrix_free);
    runtime::FullPotential potential(model.matrix_free, scene, form, workspace);
    potential.begin(u, 0 * u);
    Eigen::VectorXd gradient(model.matrix_free.space.field_size()), force(model.size()), expected;
    potential.evaluate(Eigen::VectorXd::Zero(gradient.size()), gradient);
    model.matrix_free.space.from_field(gradient, force);
    const double energy = model.elasticity.force(u, expected);
    EXPECT_NEAR(potential.elastic_energy(), energy, 1e-12 * energy);
    EXPECT_LE((force - expected).norm(), 1e-12 * expected.norm());
  }
}

TEST(FullSpaceStepperTest, RefusesObstaclesOfABodyWithoutContact) {
  const test::Bar bar = complete_bar({.cells = {3, 1, 1}});
  const FullSpaceModel model = build_full_space_model(bar.model);
  FullSpaceStepper stepper(model);
  FullSpaceScene scene;
  scene.obstacles = {runtime::Obstacle{runtime::Plane{{0, -1, 0}, {0, 1, 0}}, {}, 1e6, 1e3, 0.4}};
  EXPECT_THROW(stepper.set(scene), InputError);
}

}  // namespace
}  // namespace exmat::precompute
