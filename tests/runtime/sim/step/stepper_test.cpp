#include "runtime/sim/step/stepper.h"

#include <gtest/gtest.h>
#include <limits>
#include <string>
#include <tuple>

#include "common/core/decompositions.h"
#include "tests/support/allocation_counter.h"
#include "tests/support/random.h"
#include "tests/support/scenes.h"

namespace exmat::runtime {
namespace {

using test::Bar;
using test::BarOptions;

double largest_displacement(const Bar& bar, const Eigen::VectorXd& q) {
  const VertexArray displacement = (bar.basis() * q).reshaped<Eigen::RowMajor>(bar.basis().rows() / 3, 3);
  return displacement.rowwise().norm().maxCoeff();
}

/// Gravity along an axis that would move the free end by `share` of the bar's size if the body were linear.
Eigen::Vector3d gravity_for(const Bar& bar, int axis, double share) {
  const Eigen::MatrixXd stiffness = bar.basis().transpose() * bar.stiffness * bar.basis();
  const Eigen::VectorXd load = bar.model.modal->gravity_load.row(axis).transpose();
  const double displacement = largest_displacement(bar, stiffness.ldlt().solve(load));
  return -share * bar.length / displacement * Eigen::Vector3d::Unit(axis);
}

/// Steps until nothing moves any more.
State settle(const Model& model, const StepScene& scene, int steps) {
  State state = make_state(model);
  Workspace workspace(model, scene);
  for (int i = 0; i < steps; ++i) EXPECT_EQ(step(model, scene, state, workspace).status, 0U) << i;
  return state;
}

TEST(StepperTest, SettlesInTheStaticEquilibriumUnderGravity) {
  const Bar bar = test::make_bar();
  const auto model = prepared(bar);
  StepScene scene = free_scene(*model, Integrator::kBackwardEuler, 0.02);
  scene.mass_damping = 3;
  scene.newton.tolerance = 1e-9;
  scene.gravity_force = gravity_force(*model, gravity_for(bar, 1, 0.2));
  const State state = settle(*model, scene, 2000);
  const Eigen::VectorXd force = bar.basis().transpose() * test::full_internal_force(bar, bar.basis() * state.q);
  EXPECT_LE((force - scene.gravity_force).norm(), 1e-7 * scene.gravity_force.norm());
  EXPECT_GE(largest_displacement(bar, state.q), 0.1 * bar.length);
}

TEST(StepperTest, GravityForceIsThatOfTheFullSpace) {
  const Bar bar = test::make_bar({.density_gradient = 1});
  const auto model = prepared(bar);
  Eigen::VectorXd field(bar.mass.rows());
  for (Eigen::Index i = 0; i < field.size(); i += 3) field.segment<3>(i) = Eigen::Vector3d(1, -2, 3);
  const Eigen::VectorXd expected = bar.basis().transpose() * (bar.mass * field);
  EXPECT_LE((gravity_force(*model, {1, -2, 3}) - expected).norm(), 1e-12 * expected.norm());
}

TEST(StepperTest, VertexForceIsTheProjectedForce) {
  const Bar bar = test::make_bar();
  const Eigen::Index first = bar.basis().rows() / 3 - 2;
  Eigen::VectorXd field = Eigen::VectorXd::Zero(bar.basis().rows());
  field.tail<6>() << 1, 2, 3, 1, 2, 3;
  const Eigen::VectorXd expected = bar.basis().transpose() * field;
  const RowMatrix rows = bar.basis().middleRows(3 * first, 6);
  EXPECT_LE((vertex_force(rows, {1, 2, 3}) - expected).norm(), 1e-12 * expected.norm());
}

/// Which of predictor and start is looked at first is a guess from the last step, of whatever body that was.
TEST(StepperTest, ResultsDoNotDependOnTheGuessOfTheFirstIterate) {
  for (const Integrator integrator : kIntegrators) {
    const Bar bar = test::make_bar();
    const auto model = prepared(bar);
    const StepScene scene = free_scene(*model, integrator, 0.05);
    // Stiff modes that swing faster than steps are: at first the predictor goes too far in most of them.
    const Eigen::VectorXd q = Eigen::VectorXd::Zero(model->modes()), v = 3 * test::random_vector(model->modes(), 5);
    State states[] = {make_state(*model, q, v), make_state(*model, q, v)};
    Workspace workspaces[] = {Workspace(*model, scene), Workspace(*model, scene)};
    int from_start = 0;
    for (int i = 0; i < 200; ++i) {
      for (std::size_t guess = 0; guess < 2; ++guess) {
        workspaces[guess].predictor_was_lower = guess == 0;
        step(*model, scene, states[guess], workspaces[guess]);
        EXPECT_EQ(workspaces[guess].predictor_was_lower, workspaces[0].predictor_was_lower);
      }
      EXPECT_EQ(states[0].q, states[1].q) << i;
      EXPECT_EQ(states[0].v, states[1].v) << i;
      from_start += !workspaces[0].predictor_was_lower;
    }
    EXPECT_GT(from_start, 2);
    EXPECT_LT(from_start, 198);
  }
}

/// The state after a step satisfies the equation of motion with every term, to the tolerance.
TEST(StepperTest, SolvesTheEquationOfMotionAlsoOfSeveralDensities) {
  for (const double density_gradient : {0.0, 3.0})
    for (const Integrator integrator : kIntegrators) {
      const Bar bar = test::make_bar({.density_gradient = density_gradient, .examples = 3});
      const auto model = prepared(bar);
      // Phi^T (M_s/V) U by the definition of T = Lambda Phi^T (M_s/V) U / V^(1/3).
      const ShapeSpaceData& shape = *bar.model.shape_space;
      RowMatrix seen = std::cbrt(shape.volume) * bar.model.projection->shape_from_reduced;
      for (Eigen::Index i = 0; i < seen.rows(); ++i) seen.row(i) /= shape.eigenvalues[i / 3];
      const double mass = (bar.mass * Eigen::VectorXd::Ones(bar.mass.cols())).sum() / 3;
      StepScene scene = free_scene(*model, integrator, 0.01);
      scene.mass_damping = 0.3;
      scene.newton = {50, 1e-9};
      scene.gravity_force = gravity_force(*model, gravity_for(bar, 2, 0.3));
      scene.examples = {ExampleSettings{300, 4, 0.5}};
      State state = make_state(*model);
      Workspace workspace(*model, scene);
      for (int i = 0; i < 50; ++i) {
        ASSERT_EQ(step(*model, scene, state, workspace).status, 0U);
        const Eigen::VectorXd target = model->examples.front().target->basis() * state.examples.front().target;
        const Eigen::VectorXd elastic = bar.basis().transpose() * test::full_internal_force(bar, bar.basis() * state.q);
        const auto filtered = [&](const Eigen::VectorXd& x) -> Eigen::VectorXd {
          return seen.transpose() * (mass * (seen * x));
        };
        const Eigen::VectorXd residual = state.a + 0.3 * state.v + elastic - scene.gravity_force +
                                         300 * filtered(state.q - target) + 4 * filtered(state.v);
        ASSERT_LE(residual.norm(), 2e-9 * (state.a.norm() + elastic.norm() + scene.gravity_force.norm())) << i;
      }
    }
}

TEST(StepperTest, AStrongExampleForceHoldsTheBarAtTheTarget) {
  const Bar bar = test::make_bar({.examples = 2});
  const auto model = prepared(bar);
  StepScene scene = free_scene(*model, Integrator::kBdf2, 0.005);
  scene.mass_damping = 2;
  scene.examples = {ExampleSettings{1e7, 1e4, 0}};  // bias 0: the bent example alone
  const State state = settle(*model, scene, 2000);
  const Eigen::VectorXd target = model->examples.front().filter * bar.model.examples->examples[1].pose;
  const Eigen::VectorXd filtered = model->examples.front().filter * state.q;
  EXPECT_LE((filtered - target).norm(), 1e-3 * target.norm());
  EXPECT_EQ(state.examples.front().weights, Eigen::VectorXd::Unit(2, 1));
}

// BDF2 has no monotone energy of its own: what falls in every step of a linear body is its G-norm, |x_n|^2 +
// |2 x_n - x_n-1|^2 over positions and velocities (Dahlquist 1978). 1e-9: Newton's tolerance.
TEST(StepperTest, Bdf2LosesItsEnergyInEveryStep) {
  const Bar bar = test::make_bar();
  const auto model = prepared(bar);
  const Eigen::MatrixXd stiffness = bar.basis().transpose() * bar.stiffness * bar.basis();
  const auto energy = [&](const Eigen::VectorXd& q, const Eigen::VectorXd& v) {
    return v.squaredNorm() + q.dot(stiffness * q);
  };
  for (const double time_step : {1e-4, 1e-3, 1e-2, 0.1}) {
    StepScene scene = free_scene(*model, Integrator::kBdf2, time_step);
    scene.newton.tolerance = 1e-12;
    // So small that the body is linear.
    const Eigen::VectorXd q = 1e-7 * bar.length * test::random_vector(model->modes(), 3);
    State state = make_state(*model, q, q / 0.1);
    Workspace workspace(*model, scene);
    double before = std::numeric_limits<double>::infinity();
    for (int i = 0; i < 300; ++i) {
      step(*model, scene, state, workspace);
      const double now =
          energy(state.q, state.v) + energy(2 * state.q - state.q_previous, 2 * state.v - state.v_previous);
      ASSERT_LE(now, before * (1 + 1e-9)) << time_step << " " << i;
      before = now;
    }
  }
}

TEST(StepperTest, RestsWithoutLoadAtNoCost) {
  const Bar bar = test::make_bar({.examples = 3});
  const auto model = prepared(bar);
  for (const Integrator integrator : kIntegrators) {
    StepScene scene = free_scene(*model, integrator, 0.01);
    scene.examples = {ExampleSettings{100, 1, 1}};
    State state = make_state(*model);
    Workspace workspace(*model, scene);
    for (int i = 0; i < 10; ++i) {
      const StepReport report = step(*model, scene, state, workspace);
      ASSERT_EQ(report.status, 0U);
      ASSERT_LE(report.newton_iterations, 1);
    }
    EXPECT_LE(state.q.norm(), 1e-12 * bar.length);
  }
}

TEST(StepperTest, StagesThatAreNotNeededAreNotRun) {
  const Bar bar = test::make_bar({.examples = 3});
  const auto model = prepared(bar);
  StepScene scene = free_scene(*model, Integrator::kBdf2, 0.01);
  scene.gravity_force = gravity_force(*model, {0, -1, 0});
  Profile profile;
  const auto seconds_after_a_step = [&](Stage stage) {
    State state = make_state(*model);
    Workspace workspace(*model, scene);
    workspace.profile = &profile;
    profile = {};
    step(*model, scene, state, workspace);
    return profile.seconds[static_cast<std::size_t>(stage)];
  };
  EXPECT_EQ(seconds_after_a_step(Stage::kTarget), 0);
  EXPECT_EQ(seconds_after_a_step(Stage::kWeights), 0);
  EXPECT_GT(seconds_after_a_step(Stage::kInternalForce), 0);
  EXPECT_GT(seconds_after_a_step(Stage::kSolve), 0);
  scene.examples = {ExampleSettings{0, 0, 1}};
  EXPECT_EQ(seconds_after_a_step(Stage::kTarget), 0);
  scene.examples = {ExampleSettings{100, 0, 0.5}};
  EXPECT_GT(seconds_after_a_step(Stage::kTarget), 0);
  EXPECT_GT(seconds_after_a_step(Stage::kWeights), 0);
}

TEST(StepperTest, EnergiesAreThoseOfTheFullSpace) {
  const Bar bar = test::make_bar();
  const auto model = prepared(bar);
  StepScene scene = free_scene(*model, Integrator::kBdf2, 0.01);
  scene.gravity_force = gravity_force(*model, {0, -9.81, 0});
  State state = make_state(*model);
  Workspace workspace(*model, scene);
  for (int i = 0; i < 20; ++i) step(*model, scene, state, workspace);
  const Energies now = energies(*model, scene, state);
  const Eigen::VectorXd velocity = bar.basis() * state.v, displacement = bar.basis() * state.q;
  EXPECT_NEAR(now.kinetic, 0.5 * velocity.dot(bar.mass * velocity), 1e-12 * now.kinetic);
  EXPECT_EQ(now.elastic, model->internal_force.energy(state.q, workspace.elasticity));
  Eigen::VectorXd height = Eigen::VectorXd::Zero(displacement.size());
  for (Eigen::Index i = 1; i < height.size(); i += 3) height[i] = displacement[i];
  EXPECT_NEAR(now.potential, 9.81 * (bar.mass * height).sum(), 1e-12 * std::abs(now.potential));
  EXPECT_DOUBLE_EQ(state.time, 0.2);
}

TEST(StepperTest, TwoRunsAgreeToTheLastBit) {
  const Bar bar = test::make_bar({.examples = 3});
  const auto model = prepared(bar);
  StepScene scene = free_scene(*model, Integrator::kBdf2, 0.01);
  scene.gravity_force = gravity_force(*model, {0, -9.81, 0});
  scene.stiffness_damping = 0.001;
  scene.examples = {ExampleSettings{300, 4, 0.5}};
  EXPECT_EQ(settle(*model, scene, 100).q, settle(*model, scene, 100).q);
}

TEST(StepperTest, NonFiniteInputSetsTheBitAndKeepsTheState) {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  const Bar bar = test::make_bar({.examples = 3});
  const auto model = prepared(bar);
  for (const Integrator integrator : kIntegrators)
    for (const double poison : {kNan, std::numeric_limits<double>::infinity(), 1e300}) {
      StepScene scene = free_scene(*model, integrator, 0.01);
      scene.examples = {ExampleSettings{300, 4, 0.5}};
      scene.gravity_force = gravity_force(*model, {0, -9.81, 0});
      State state = make_state(*model);
      Workspace workspace(*model, scene);
      for (int i = 0; i < 3; ++i) step(*model, scene, state, workspace);
      const State sound = state;

      scene.gravity_force[1] = poison;
      EXPECT_NE(step(*model, scene, state, workspace).status & kStepNonFinite, 0U);
      EXPECT_EQ(state.q, sound.q);
      EXPECT_EQ(state.v, sound.v);
      EXPECT_EQ(state.step, sound.step);
      EXPECT_EQ(state.examples.front().weights, sound.examples.front().weights);

      scene.gravity_force.setZero();
      state.v[0] = poison;
      EXPECT_NE(step(*model, scene, state, workspace).status & kStepNonFinite, 0U);
      EXPECT_EQ(state.q, sound.q);

      state = sound;
      EXPECT_EQ(step(*model, scene, state, workspace).status, 0U) << "the workspace remembers the poison";
    }
}

TEST(Stepper, SubnormalNumbersBecomeZeroAndAreReported) {
  const Bar bar = test::make_bar();
  const auto model = prepared(bar);
  const StepScene scene = free_scene(*model, Integrator::kBdf2, 1e-3);
  State state = make_state(*model);
  state.q.setConstant(1e-310);
  state.v.setConstant(-1e-309);
  Workspace workspace(*model, scene);
  EXPECT_EQ(step(*model, scene, state, workspace).status, kStepSubnormal);
  EXPECT_EQ(state.q, Eigen::VectorXd::Zero(model->modes()));
  EXPECT_EQ(step(*model, scene, state, workspace).status, 0U);
}

// Few iterations a step lag behind, report it, and arrive where many do.
TEST(Stepper, ABoundedTargetCarriesOnInTheNextStep) {
  const Bar bar = test::make_bar({.examples = 4});
  const auto model = prepared(bar);
  StepScene scene = free_scene(*model, Integrator::kBdf2, 1e-3);
  scene.examples = {ExampleSettings{1e-12, 0, 0.1, 1}};  // the body stays where it is, and with it the weights
  const TargetSolver& solver = *model->examples.front().target;
  State state = make_state(*model);
  Workspace workspace(*model, scene);
  int steps = 0;
  while (!state.examples.front().target_converged && steps < 50) {
    const StepReport report = step(*model, scene, state, workspace);
    EXPECT_LE(report.target_iterations, 1);
    EXPECT_EQ((report.status & kTargetNotConverged) != 0, !state.examples.front().target_converged) << steps;
    ++steps;
  }
  EXPECT_GT(steps, 1);
  ASSERT_TRUE(state.examples.front().target_converged);
  auto scratch = solver.make_workspace();
  Eigen::VectorXd expected(solver.dimension());
  solver.start(state.examples.front().weights, expected);
  solver.solve(state.examples.front().weights, scratch, expected);
  EXPECT_LE((state.examples.front().target - expected).norm(), 1e-8 * expected.norm());
}

class ExtremeRuns : public ::testing::TestWithParam<std::tuple<double, double, double, int>> {};

INSTANTIATE_TEST_SUITE_P(All, ExtremeRuns,
                         ::testing::Combine(::testing::Values(1e6, 1e8, 1e11), ::testing::Values(0.4, 0.499),
                                            ::testing::Values(0.001, 1.0 / 60), ::testing::Values(0, 1, 2, 3)));

/// Twenty times a load that already bends, stretches or compresses visibly, and a blow: bounded by 8 L.
TEST_P(ExtremeRuns, StayFiniteAndBounded) {
  const auto [youngs_modulus, poisson_ratio, time_step, load] = GetParam();
  const Bar bar = test::make_bar({.youngs_modulus = youngs_modulus, .poisson_ratio = poisson_ratio, .examples = 4});
  const auto model = prepared(bar);
  for (const Integrator integrator : {Integrator::kBdf2, Integrator::kBackwardEuler}) {
    StepScene scene = free_scene(*model, integrator, time_step);
    scene.stiffness_damping = load == 1 ? 0.003 : 0;
    State state = make_state(*model);
    if (load == 3) {
      const double speed = 20 * 0.1 * bar.length * std::sqrt(youngs_modulus / 1000) / bar.length;
      state = make_state(*model, state.q, speed / model->gravity_load.row(1).norm() * model->gravity_load.row(1));
    } else {
      // Down, along the bar against the clamp, along the bar away from it.
      const Eigen::Vector3d gravity = gravity_for(bar, load == 0 ? 1 : 0, 0.1) * (load == 2 ? -1 : 1);
      scene.gravity_force = 20 * gravity_force(*model, gravity);
    }
    Workspace workspace(*model, scene);
    for (int i = 0; i < 120; ++i) {
      ASSERT_EQ(step(*model, scene, state, workspace).status & kStepNonFinite, 0U) << i;
      ASSERT_LE(largest_displacement(bar, state.q), 8 * bar.length) << i;
    }
  }
}

enum class Target { kNone, kTable, kSolve };

/// Allocations of steps from rest; the force ends after two of them.
std::size_t allocations_of_steps(const Model& model, const StepScene& scene, bool profiled) {
  State state = make_state(model);
  Workspace workspace(model, scene);
  Profile profile;
  if (profiled) workspace.profile = &profile;
  const test::AllocationCounter counter;
  for (int i = 0; i < 4; ++i) step(model, scene, state, workspace);
  energies(model, scene, state);
  return counter.count();
}

void expect_no_allocation(const Model& model, Target target) {
  for (const Integrator integrator : kIntegrators)
    for (const bool damped : {false, true})
      for (const bool scripted : {false, true})
        for (const bool profiled : {false, true}) {
          StepScene scene = free_scene(model, integrator, 0.01);
          scene.gravity_force = gravity_force(model, {0, -20, -5});
          if (damped) scene.mass_damping = scene.stiffness_damping = 0.01;
          if (target != Target::kNone) scene.examples = {ExampleSettings{300, 4, 0.5}};
          if (scripted) scene.forces.push_back({scene.gravity_force, 0, 0.025});
          EXPECT_EQ(allocations_of_steps(model, scene, profiled), 0U)
              << static_cast<int>(integrator) << damped << scripted << profiled;
        }
}

TEST(AllocationTest, NoStepAllocates) {
  if (!test::AllocationCounter::works()) GTEST_SKIP() << "a sanitizer owns malloc";
  for (const double density_gradient : {0.0, 3.0}) {
    const Bar bar = full_bar({.cells = {5, 2, 2},
                              .density_gradient = density_gradient,
                              .linear_modes = 18,
                              .eigenfunctions = 8,
                              .examples = 4});
    for (const Target target : {Target::kNone, Target::kTable, Target::kSolve})
      for (const bool polynomial : {false, true}) {
        SCOPED_TRACE(::testing::Message() << "target " << static_cast<int>(target) << " polynomial " << polynomial);
        expect_no_allocation(*prepared(bar, {.target_table = target == Target::kTable, .polynomial = polynomial}),
                             target);
      }
  }
}

TEST(AllocationTest, NorDoesAStepOfManyModes) {
  if (!test::AllocationCounter::works()) GTEST_SKIP() << "a sanitizer owns malloc";
  // Large enough for blocked products and factorisations.
  const BarOptions options{.cells = {8, 3, 3}, .linear_modes = 47, .eigenfunctions = 14, .examples = 4};
  expect_no_allocation(*prepared(test::make_bar(options)), Target::kSolve);
}

TEST(AllocationTest, NorDoesAProjectedStiffness) {
  if (!test::AllocationCounter::works()) GTEST_SKIP() << "a sanitizer owns malloc";
  const Bar bar = test::make_bar({.cells = {8, 3, 3}, .linear_modes = 44, .examples = 4});
  const auto model = prepared(bar);
  StepScene scene = free_scene(*model, Integrator::kBackwardEuler, 0.05);
  scene.stiffness_damping = 0.01;
  const Eigen::VectorXd compressed = -3.3 * bar.basis().transpose() * bar.mass * bar.example_fields[3];
  State state = make_state(*model, compressed, Eigen::VectorXd::Zero(compressed.size()));
  Workspace workspace(*model, scene);
  StepReport report;
  std::size_t allocations = 0;
  {
    const test::AllocationCounter counter;
    report = step(*model, scene, state, workspace);
    allocations = counter.count();
  }
  EXPECT_GT(report.projections, 0);
  EXPECT_EQ(allocations, 0U);
}

TEST(AllocationTest, TheCounterCounts) {
  if (!test::AllocationCounter::works()) GTEST_SKIP() << "a sanitizer owns malloc";
  const test::AllocationCounter counter;
  const Eigen::VectorXd vector = Eigen::VectorXd::Zero(100);
  EXPECT_GE(counter.count(), 1U);
  EXPECT_EQ(vector.size(), 100);
}

TEST(ModelTest, AMissingGroupIsNamed) {
  Bar bar = test::make_bar({.examples = 2});
  bar.model.projection.reset();
  EXPECT_EQ(build_model(bar.model, {}).complaint.place, "/projection");
  bar.model.cubature.reset();
  EXPECT_EQ(build_model(bar.model, {}).complaint.place, "/cubature");
}

}  // namespace
}  // namespace exmat::runtime
